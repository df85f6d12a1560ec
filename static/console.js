// The console of a live event: it looks for news every two seconds, and the running order is put right by dragging.
// Without this script the buttons do the same.
"use strict";

(() => {
  const LOOK_MS = 2000;
  const console_ = document.querySelector("[data-console]");
  if (!console_) return;
  let dragged = null;

  setInterval(() => {
    if (!dragged && !document.hidden) htmx.trigger(document.getElementById("console"), "paddock:look");
  }, LOOK_MS);

  const place = (event) => event.target.closest && event.target.closest("[data-slot][draggable]");

  document.addEventListener("dragstart", (event) => {
    dragged = place(event);
    if (!dragged) return;
    event.dataTransfer.effectAllowed = "move";
    event.dataTransfer.setData("text/plain", dragged.dataset.slot);
    dragged.classList.add("dragged");
  });
  document.addEventListener("dragover", (event) => {
    const over = dragged && place(event);
    if (!over) return;
    event.preventDefault();
    document.querySelectorAll(".drop-here").forEach((one) => one.classList.remove("drop-here"));
    if (over !== dragged) over.classList.add("drop-here");
  });
  document.addEventListener("drop", (event) => {
    const over = dragged && place(event);
    if (!over || over === dragged) return;
    event.preventDefault();
    const rows = [...document.querySelectorAll("[data-slot][draggable]")];
    // dragged down, it comes behind what it was dropped on
    const down = rows.indexOf(dragged) < rows.indexOf(over);
    const before = down ? rows[rows.indexOf(over) + 1] : over;
    const form = dragged.querySelector("form").cloneNode(true);
    for (const [name, value] of [["action", "move"], ["before", before ? before.dataset.slot : ""]]) {
      form.append(Object.assign(document.createElement("input"), { type: "hidden", name, value }));
    }
    form.hidden = true;
    document.body.append(form);
    form.submit();
  });
  document.addEventListener("dragend", () => {
    document.querySelectorAll(".dragged, .drop-here").forEach((one) => one.classList.remove("dragged", "drop-here"));
    dragged = null;
  });
})();
