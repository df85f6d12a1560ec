// Reactions on a phone: sends them without leaving the page, and shows the reactions of others rising from the buttons.
"use strict";

(() => {
  const MOST_AT_ONCE = 6;
  const RISE_MS = 1600;
  const still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
  const form = document.querySelector("[data-reactions]");
  if (!form) return;
  const refused = form.querySelector("[data-refused]");
  let counts = null;

  const rise = (button, number) => {
    for (let i = 0; i < Math.min(number, MOST_AT_ONCE) && !still(); i += 1) {
      const flies = button.querySelector(".emoji").cloneNode(true);
      flies.classList.add("flies");
      button.append(flies);
      const aside = 40 * (Math.random() - 0.5);
      flies.animate([{ transform: "none", opacity: 1 }, { transform: `translate(${aside}px, -140px) scale(1.6)`, opacity: 0 }], { duration: RISE_MS, delay: 120 * i, easing: "ease-out" }).finished.finally(() => flies.remove());
    }
  };

  const show = (told) => {
    for (const [kind, count] of Object.entries(told)) {
      const place = form.querySelector(`[data-count="${kind}"]`);
      if (!place) continue;
      if (counts && count > counts[kind]) rise(place.closest("button"), count - counts[kind]);
      place.textContent = String(count);
    }
    counts = { ...told };
  };

  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const body = new FormData(form);
    body.set("kind", event.submitter.value);
    refused.className = "hidden";
    try {
      const answer = await fetch(form.action, { method: "POST", body, headers: { Accept: "application/json" } });
      const said = await answer.json();
      if (answer.ok) show(said.reactions);
      else { refused.textContent = said.detail; refused.className = "refused"; }
    } catch { /* a reaction less */ }
  });

  const root = document.querySelector("[data-show]");
  root.addEventListener("show:reactions", ({ detail }) => show(detail));
  root.addEventListener("show:state", ({ detail }) => {
    form.hidden = !["lobby", "running", "paused", "ended"].includes(detail.phase);
  });
})();
