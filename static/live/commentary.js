// The commentator's page: decisions come with the stream (live-page.js), and the page requests the sentence about a car
// once the show has played it (loads after live/show.js).
"use strict";

(() => {
  const LATER_MS = 300; // a clock that was measured may be ahead of the server's

  document.querySelectorAll("[data-show]").forEach((root) => {
    let begun = null;
    let timer = 0;
    const ask = () => {
      timer ||= setTimeout(() => { timer = 0; window.livePage.moved([root.dataset.follow]); }, LATER_MS);
    };
    root.addEventListener("show:event", ask);
    root.addEventListener("show:frame", ({ detail: { moment } }) => { // the first of a run: it is on track
      const { slot } = root.show;
      const run = slot && `${slot.slot} ${slot.starts_at}`;
      if (moment < 0 || run === begun) return;
      begun = run;
      ask();
    });
  });
})();
