// Draws the cameras of the cars on track beside the map, in step with their poses, from the stream or, for frames that
// it lacks, from requests (loads after live/show.js).
"use strict";

(() => {
  const EVERY = 3; // steps between two frames of a strip: races/live/streaming/camera.py
  const [WIDE, HIGH] = [160, 120];
  const AHEAD = 2; // chunks
  const LATE = 4;
  const AT_ONCE = 2; // requests
  const KEPT = 8; // strips
  const SILENT_MS = 2500; // so long the stream may say nothing of a run that is played
  const OPEN = "paddock-sees";

  class Sight {
    constructor(root, panel) {
      Object.assign(this, { root, panel, strips: new Map(), of: "", drawn: "", asked: 0, told: null, large: false, heardAt: -Infinity });
      this.cars = panel.querySelector("[data-cars]");
      this.topic = document.querySelector("[data-again]") ? "" : panel.dataset.sees;
      panel.hidden = false;
      try { panel.open = localStorage.getItem(OPEN) === "1"; } catch { /* it stays closed */ }
      panel.addEventListener("toggle", () => {
        try { localStorage.setItem(OPEN, panel.open ? "1" : ""); } catch { /* not remembered */ }
        this.follow();
      });
      this.follow();
      document.addEventListener("paddock:said", ({ detail: { to, data } }) => { if (to === this.topic) this.said(data); });
      root.addEventListener("show:state", () => { if (!root.show.slot) this.end(); });
      root.addEventListener("show:frame", ({ detail }) => { if (panel.open) this.frame(detail); });
    }

    follow() {
      if (this.panel.open && this.topic) this.panel.dataset.follow = this.topic;
      else delete this.panel.dataset.follow;
      window.livePage.follow();
    }

    // The stream tells the frames of a chunk, or that there are some.
    async said({ slot, n, png }) {
      if (!this.panel.open || !this.root.show.slot || this.root.show.slot.slot !== slot) return;
      if (this.of !== this.name()) this.begin(this.root.show.slot);
      this.heardAt = performance.now();
      this.told ??= n;
      this.large = !png;
      if (!png || this.strips.get(n)?.picture) return;
      const strip = this.keep(n, { picture: null });
      const bytes = Uint8Array.from(atob(png), (each) => each.charCodeAt(0));
      strip.picture = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    }

    name() { return `${this.root.show.slot.slot} ${this.root.show.slot.starts_at}`; }

    keep(n, strip) {
      this.strips.set(n, strip);
      while (this.strips.size > KEPT) this.strips.delete(this.strips.keys().next().value);
      return strip;
    }

    // One canvas for each car, with its racer's name where there are several.
    begin(slot) {
      this.of = this.name();
      this.told = null;
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
      if (this.of !== this.name()) this.begin(show.slot);
      const [long, ms] = [show.state.chunk_ms, show.car.columns.t[i]];
      const now = Math.floor(ms / long);
      const streams = show.feed?.streams && performance.now() - this.heardAt < SILENT_MS;
      for (let n = now; n <= now + AHEAD; n += 1) if (!streams || n < this.told || this.large) this.load(n, long);
      for (let n = now; n >= now - LATE; n -= 1) {
        const strip = this.strips.get(n);
        if (!strip || !strip.picture) continue;
        strip.t ??= this.moments(n, long);
        const at = strip.t.findLastIndex((t) => t <= ms);
        if (at >= 0 && this.drawn !== `${n} ${at}`) {
          this.drawn = `${n} ${at}`;
          [...this.cars.children].forEach((figure, row) => this.draw(figure, strip, at, row));
        }
        return;
      }
    }

    // Of which steps the frames of a chunk are.
    moments(n, long) {
      return this.root.show.car.columns.t.filter((each) => Math.floor(each / long) === n).filter((_, at) => at % EVERY === 0);
    }

    draw(figure, { picture, t }, at, row) {
      const { show } = this.root;
      figure.firstChild.getContext("2d").drawImage(picture, at * WIDE, row * HIGH, WIDE, HIGH, 0, 0, WIDE, HIGH);
      const { columns } = show.replay.cars[row];
      const step = columns.t.findLastIndex((each) => each <= t[at]);
      const told = step < 0 ? "" : `${columns.steer[step].toFixed(0)}° · ${columns.v[step].toFixed(1)} m/s`.replace("-", "−");
      figure.lastChild.lastChild.textContent = told;
    }

    // A chunk whose poses are here has passed, so its strip is to be had. What comes too late is not asked for again.
    async load(n, long) {
      if (this.strips.has(n) || this.asked >= AT_ONCE) return;
      const t = this.moments(n, long);
      if (!t.length) return;
      const [strip, of] = [this.keep(n, { t, picture: null }), this.of];
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
