// The console of a live event: polls for finished computations and ended countdowns, which send no event, reorders runs
// by drag and drop, and sends each action only once.
"use strict";

(() => {
  const LOOK_MS = 2000;
  const RARELY_MS = 30000;
  const SENT_MS = 8000; // then an answer is not to be hoped for
  const console_ = document.querySelector("[data-console]");
  if (!console_) return;
  let dragged = null;

  let streams = false;
  let lookedAt = performance.now();
  let missed = false;
  document.addEventListener("paddock:stream", ({ detail: { up } }) => { streams = up; });

  const part = () => document.getElementById("console");
  function look() {
    lookedAt = performance.now();
    htmx.trigger(part(), "paddock:look");
  }
  setInterval(() => {
    if (dragged || document.hidden) return;
    const waits = part().hasAttribute("data-waits") || !streams;
    if (waits || performance.now() - lookedAt > RARELY_MS) look();
  }, LOOK_MS);

  // nothing moves under a hand that drags
  document.addEventListener("htmx:beforeRequest", (event) => {
    if (!dragged || event.detail.elt !== part()) return;
    event.preventDefault();
    missed = true;
  });

  let sent = 0;
  document.addEventListener("submit", (event) => {
    if (performance.now() - sent < SENT_MS && sent) event.preventDefault();
    else sent = performance.now();
  });
  addEventListener("pageshow", () => { sent = 0; });

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
    if (missed) look();
    missed = false;
  });
})();
