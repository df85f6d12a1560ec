// Parts of a page that ask for themselves again. What is new is written into what stands there, so that focus stays where
// it is; it is said politely to those who listen, one message in two seconds at most. Needs htmx, and comes after it.
"use strict";

(() => {
  const PAUSE_MS = 2000;

  // --- hx-swap="morph": the same elements with what is new in them ---------------------------------------------------
  const alike = (one, other) => one.nodeType === other.nodeType && one.nodeName === other.nodeName && one.id === other.id;

  function morph(old, fresh) {
    for (const { name } of [...old.attributes]) if (!fresh.hasAttribute(name)) old.removeAttribute(name);
    for (const { name, value } of [...fresh.attributes]) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
    const before = [...old.childNodes];
    const after = [...fresh.childNodes];
    after.forEach((node, index) => {
      const was = before[index];
      if (!was) old.append(node);
      else if (!alike(was, node)) was.replaceWith(node);
      else if (node.nodeType === Node.ELEMENT_NODE) morph(was, node);
      else if (was.data !== node.data) was.data = node.data;
    });
    before.slice(after.length).forEach((node) => node.remove());
  }

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

  // --- what is new is said: data-say of an element with an id ----------------------------------------------------------
  const said = new Map();
  const waiting = new Map();
  let last = -Infinity;
  let timer = 0;

  function speak() {
    timer = 0;
    const region = document.querySelector("[data-live-said]");
    if (!region || !waiting.size) return;
    region.textContent = [...waiting.values()].join(" ");
    waiting.clear();
    last = performance.now();
  }

  function listen(first) {
    document.querySelectorAll("[data-say][id]").forEach(({ id, dataset }) => {
      if (said.get(id) === dataset.say) return;
      said.set(id, dataset.say);
      if (!first && dataset.say) waiting.set(id, dataset.say);
    });
    if (waiting.size && !timer) timer = setTimeout(speak, Math.max(0, last + PAUSE_MS - performance.now()));
  }
  listen(true);
  document.addEventListener("htmx:afterSettle", () => listen(false));
})();
