// Parts of a page that htmx asks for. What is new is written into what stands there (moves.js), so that focus stays where
// it is. Needs htmx, and comes after it.
"use strict";

(() => {
  const { morph } = window.paddockMoves;
  const alike = (one, other) => one.nodeName === other.nodeName && one.id === other.id;

  // --- hx-swap="morph": the same elements with what is new in them ---------------------------------------------------
  htmx.defineExtension("morph", {
    handleSwap(style, target, fragment) {
      const fresh = fragment.firstElementChild;
      if (style !== "morph" || !fresh) return false;
      if (!alike(target, fresh)) {
        target.replaceWith(fresh);
        return [fresh];
      }
      morph(target, fresh);
      return [target];
    },
  });

  // --- focus that was in a part which is gone goes to the heading of what came in its place ---------------------------
  let left = "";
  document.addEventListener("htmx:beforeSwap", ({ detail: { target } }) => {
    left = target.contains(document.activeElement) && document.activeElement !== document.body ? target.id : "";
  });
  document.addEventListener("htmx:afterSettle", () => {
    const place = left && document.activeElement === document.body && document.getElementById(left);
    left = "";
    if (!place) return;
    const head = place.querySelector("h1, h2") || place;
    head.tabIndex = -1;
    head.focus({ preventScroll: true });
  });
})();
