// What the cars on track see, beside the map: frames of their cameras, in step with the poses. They are asked for half a
// second at a time, once that has come as poses, and only while somebody has opened the panel. Comes after show.js.
"use strict";

(() => {
  const EVERY = 3; // steps between two frames of a strip: races/live_seen.py
  const [WIDE, HIGH] = [160, 120];
  const AHEAD = 2; // chunks
  const LATE = 4;
  const AT_ONCE = 2; // requests
  const KEPT = 8; // strips
  const OPEN = "paddock-sees";

  class Sight {
    constructor(root, panel) {
      Object.assign(this, { root, panel, strips: new Map(), of: "", drawn: "", asked: 0 });
      this.cars = panel.querySelector("[data-cars]");
      panel.hidden = false;
      try { panel.open = localStorage.getItem(OPEN) === "1"; } catch { /* it stays closed */ }
      panel.addEventListener("toggle", () => {
        try { localStorage.setItem(OPEN, panel.open ? "1" : ""); } catch { /* not remembered */ }
      });
      root.addEventListener("show:state", () => { if (!root.show.slot) this.end(); });
      root.addEventListener("show:frame", ({ detail }) => { if (panel.open) this.frame(detail); });
    }

    // One canvas for each car, with its racer's name where there are several.
    begin(slot) {
      this.of = `${slot.slot} ${slot.starts_at}`;
      this.strips.clear();
      this.drawn = "";
      this.asked = 0;
      const alone = slot.cars.length < 2;
      this.cars.replaceChildren(...slot.cars.map(({ racer }) => {
        const [figure, canvas, caption] = ["figure", "canvas", "figcaption"].map((tag) => document.createElement(tag));
        const [name, said] = [document.createElement("span"), document.createElement("span")];
        Object.assign(canvas, { width: WIDE, height: HIGH, className: "seen-frame" });
        canvas.setAttribute("role", "img");
        canvas.setAttribute("aria-label", this.panel.dataset.label.replace("%s", racer));
        [name.className, said.className] = ["name", "num"];
        name.textContent = alone ? "" : racer;
        caption.append(name, said);
        figure.append(canvas, caption);
        return figure;
      }));
    }

    // Nobody is on track.
    end() {
      this.of = "";
      this.strips.clear();
      this.cars.replaceChildren();
    }

    // Of the step that the map shows; while its frame is still to come, the last one before it.
    frame({ moment, i }) {
      const { show } = this.root;
      if (!show.slot || moment < 0) return;
      if (this.of !== `${show.slot.slot} ${show.slot.starts_at}`) this.begin(show.slot);
      const [long, ms] = [show.state.chunk_ms, show.car.t[i]];
      const now = Math.floor(ms / long);
      for (let n = now; n <= now + AHEAD; n += 1) this.load(n, long);
      for (let n = now; n >= now - LATE; n -= 1) {
        const strip = this.strips.get(n);
        if (!strip || !strip.picture) continue;
        const at = strip.t.findLastIndex((t) => t <= ms);
        if (at >= 0 && this.drawn !== `${n} ${at}`) {
          this.drawn = `${n} ${at}`;
          [...this.cars.children].forEach((figure, row) => this.draw(figure, strip, at, row));
        }
        return;
      }
    }

    draw(figure, { picture, t }, at, row) {
      const { show } = this.root;
      figure.firstChild.getContext("2d").drawImage(picture, at * WIDE, row * HIGH, WIDE, HIGH, 0, 0, WIDE, HIGH);
      const car = row ? show.rivals[row - 1]?.track : show.car;
      const step = car ? car.t.findLastIndex((each) => each <= t[at]) : -1;
      const told = step < 0 ? "" : `${car.steer[step].toFixed(0)}° · ${car.v[step].toFixed(1)} m/s`.replace("-", "−");
      figure.lastChild.lastChild.textContent = told;
    }

    // A chunk whose poses are here has passed, so its strip is to be had. What comes too late is not asked for again.
    async load(n, long) {
      if (this.strips.has(n) || this.asked >= AT_ONCE) return;
      const t = this.root.show.car.t.filter((each) => Math.floor(each / long) === n).filter((_, at) => at % EVERY === 0);
      if (!t.length) return;
      const [strip, of] = [{ t, picture: null }, this.of];
      this.strips.set(n, strip);
      while (this.strips.size > KEPT) this.strips.delete(this.strips.keys().next().value);
      this.asked += 1;
      try {
        const query = new URLSearchParams({ slot: this.root.show.slot.slot, n });
        const answer = await fetch(`${this.panel.dataset.frames}?${query}`, { signal: AbortSignal.timeout(5000) });
        if (answer.status === 200) strip.picture = await createImageBitmap(await answer.blob());
      } catch { /* the frames before stay */ }
      if (this.of === of) this.asked -= 1;
    }
  }

  for (const panel of document.querySelectorAll("[data-frames]")) new Sight(panel.closest("[data-show]"), panel);
})();
