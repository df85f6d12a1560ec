// The console of a live event: it looks for news every two seconds, and the running order is put right by dragging.
// Without this script the buttons do the same.
"use strict";

(() => {
  const LOOK_MS = 2000;
  const console_ = document.querySelector("[data-console]");
  const form = document.querySelector("[data-move]");
  if (!console_ || !form) return;
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
    form.elements.version.value = document.querySelector("#console input[name='version']").value;
    form.elements.slot.value = dragged.dataset.slot;
    form.elements.before.value = before ? before.dataset.slot : "";
    form.submit();
  });
  document.addEventListener("dragend", () => {
    document.querySelectorAll(".dragged, .drop-here").forEach((one) => one.classList.remove("dragged", "drop-here"));
    dragged = null;
  });
})();
