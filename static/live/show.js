// Plays the run on track at the same instant for everybody, from half-second chunks of poses (live/live-feed.js), and
// dispatches "show:state", "show:reactions", "show:frame" and "show:event" on [data-show].
"use strict";

(() => {
  const JUMP_M = 0.6; // a reset moves a car at once: nothing to glide over
  const NOSE_M = 0.14; // a trace has the car's nose, which is so far before its middle; of a bot it has the middle
  const TAIL_MS = 1500;
  const STILL_MS = 1000;
  const FIGURES_MS = 100; // nobody reads faster
  const LEFT_MS = 500; // so long a car stands where its run ended
  const LOST_MS = 30000; // and so long one of whose run nothing more came
  const CAR = 0.025 * 2.4; // of the map's longer side
  const NONE = document.createElement("i"); // what a screen does not show
  const EMPTY = { v: [], steer: [], lap: [], status: [] };
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  const clock = (ms) => {
    const whole = Math.max(0, Math.floor(ms));
    return `${Math.floor(whole / 60000)}:${String(Math.floor(whole / 1000) % 60).padStart(2, "0")}.${String(whole % 1000).padStart(3, "0")}`;
  };

  // The steps of a car, as they come, and where it is at a moment.
  class Track {
    constructor() { this.t = []; this.x = []; this.y = []; this.yaw = []; this.v = []; this.steer = []; this.lap = []; this.status = []; this.laps = []; this.index = 0; }
    add(columns) {
      for (const name of ["t", "x", "y", "yaw", "v", "steer", "lap", "status"]) this[name].push(...columns[name]);
      for (const lap of columns.lap) if (!this.laps.includes(lap)) this.laps.push(lap);
    }
    at(moment) {
      const { t, x, y, yaw } = this;
      if (!t.length) return null;
      let i = t[this.index] > moment ? 0 : this.index;
      while (i < t.length - 1 && t[i + 1] <= moment) i += 1;
      this.index = i;
      const next = Math.min(i + 1, t.length - 1);
      const share = next === i ? 0 : Math.min(1, Math.max(0, (moment - t[i]) / (t[next] - t[i])));
      const glide = next !== i && Math.hypot(x[next] - x[i], y[next] - y[i]) <= JUMP_M;
      const turn = ((yaw[next] - yaw[i] + 540) % 360) - 180;
      return {
        i, x: glide ? x[i] + share * (x[next] - x[i]) : x[i], y: glide ? y[i] + share * (y[next] - y[i]) : y[i],
        yaw: glide ? yaw[i] + share * turn : yaw[i], v: this.v[i] ?? 0, steer: this.steer[i] ?? 0, lap: this.laps.indexOf(this.lap[i]) + 1, status: this.status[i],
      };
    }
  }

  class Show {
    constructor(root) {
      this.root = root;
      this.parts = new Map();
      this.Track = Track;
      const { follow: topic, show: state, poses } = root.dataset;
      const hear = {
        state: (told) => { this.state = told; this.take(told.current); this.tell("state", told); },
        reactions: (counts) => this.tell("reactions", counts),
        poses: (told) => this.add(told),
      };
      this.feed = new window.paddockFeed.Feed({ topic, state, poses }, hear);
      this.clock = this.feed.clock;
      this.forget();
      const map = root.querySelector("svg.overlay");
      if (!map) return;
      this.map = map;
      new ResizeObserver(() => this.measure()).observe(map);
      this.measure();
    }

    // An element of the page; a screen shows some of them.
    part(name) {
      const known = this.parts.get(name);
      if (known && (known.isConnected || known === NONE)) return known;
      const found = this.root.querySelector(`[data-${name}]`) || NONE;
      this.parts.set(name, found);
      return found;
    }

    // Where the map's coordinates are in pixels: asked for when its size changes, and never while cars are drawn.
    measure() {
      const [matrix, place] = [this.map.getScreenCTM(), this.map.parentNode.getBoundingClientRect()];
      const box = this.map.viewBox.baseVal;
      if (!matrix || !matrix.a) return;
      this.pixels = { scale: matrix.a, x: matrix.e - place.left, y: matrix.f - place.top };
      this.map.parentNode.style.setProperty("--mover", `${(CAR * Math.max(box.width, box.height) * matrix.a).toFixed(1)}px`);
    }

    forget() {
      this.slot = null;
      this.feed.play(null);
      this.clear();
      this.best = null;
      this.over = false;
    }

    clear() {
      this.car = new Track();
      [...(this.rivals || []), ...(this.bots || [])].forEach(({ shape }) => shape.remove());
      this.rivals = [];
      this.bots = [];
      this.waiting = [];
      this.lapFrom = 0;
      this.step = null;
      this.drawnAt = -Infinity;
    }

    tell(name, detail) { this.root.dispatchEvent(new CustomEvent(`show:${name}`, { detail, bubbles: true })); }

    write(name, text) {
      const part = this.part(name);
      if (part === NONE || part.textContent === text) return;
      const node = part.firstChild;
      if (node && node === part.lastChild && node.nodeType === Node.TEXT_NODE) node.data = text;
      else part.textContent = text;
    }

    take(current) {
      const id = current && current.slot;
      if (id && this.slot && id === this.slot.slot && current.starts_at === this.slot.starts_at) { this.slot = current; return; }
      if (!id) {
        // what is left of a run that is over is played to its end; a launch that was undone is gone at once
        if (this.slot && (this.clock.now() < this.slot.starts_at || this.isPlayed())) this.leave();
        return;
      }
      this.forget();
      this.slot = current;
      this.feed.play(current);
      this.part("stage-card").hidden = !this.state || !["running", "paused"].includes(this.state.phase);
      this.blank();
      this.part("who").replaceChildren(...this.names(current));
      this.begin();
    }

    // Who drives; in a duel each in the colour of their car.
    names(current) {
      if (current.cars.length < 2) return [current.racer];
      return current.cars.flatMap(({ number, racer }) => {
        const name = document.createElement("span");
        name.className = number ? "show-name rival" : "show-name";
        name.textContent = racer;
        if (!number) return [name];
        const between = document.createElement("span"); // where there is room they stand below each other
        between.className = "show-between";
        between.textContent = " – ";
        return [between, name];
      });
    }

    // Nothing of the run before is left.
    blank() {
      this.part("car").setAttribute("hidden", "");
      this.part("ghost").setAttribute("hidden", "");
      this.part("tail").setAttribute("points", "");
      for (const name of ["clock", "lap-number", "speed", "steer", "last-lap", "best-lap"]) this.write(name, name === "clock" ? "" : "–");
    }

    // Nobody is on track.
    leave() {
      this.forget();
      this.blank();
      const [next] = (this.state && this.state.next) || [];
      this.write("who", next ? this.root.dataset.upNext.replace("%s", () => next.racer) : this.root.dataset.nobody);
      this.tell("state", this.state);
    }

    // Poses have come. before: of the part of the run that this page never saw, what happened and which laps were begun.
    add({ chunks, over, before }) {
      if (before) {
        this.clear();
        this.car.laps = [...before.laps];
        this.waiting = [...before.events];
      }
      for (const chunk of chunks) {
        if (chunk.cars[0]) this.car.add(chunk.cars[0]);
        chunk.cars.slice(1).forEach((columns, at) => this.rival(at).track.add(columns));
        chunk.bots.forEach((columns, at) => this.bot(at).track.add({ ...EMPTY, ...columns, t: chunk.cars[0].t.slice(0, columns.x.length) }));
        this.waiting.push(...chunk.events);
      }
      this.over = over;
      this.begin();
    }

    // --- drawing: while somebody is on track, a frame moves cars, and nothing else ---------------------------------------
    begin() {
      if (this.drawing || !this.slot) return;
      this.drawing = true;
      requestAnimationFrame(() => this.draw());
    }

    moment() {
      const moment = this.clock.now() - this.slot.starts_at - this.state.behind_ms;
      return still.matches ? Math.floor(moment / STILL_MS) * STILL_MS : moment; // from place to place, without gliding
    }

    // Whether there is nothing left to play: it was, or nothing came for long.
    isPlayed() { return this.moment() > (this.car.t[this.car.t.length - 1] ?? 0) + (this.over ? LEFT_MS : LOST_MS); }

    draw() {
      this.drawing = Boolean(this.slot);
      if (!this.slot) return;
      requestAnimationFrame(() => this.draw());
      if (!this.state || !this.clock.known) return;
      const soon = this.slot.starts_at - this.clock.now();
      if (soon > 0) {
        this.write("clock", this.root.dataset.soon.replace("%s", String(Math.ceil(soon / 1000))));
        return;
      }
      if (!this.state.current && this.isPlayed()) { this.leave(); return; }
      const moment = this.moment();
      const place = this.car.at(Math.max(0, moment));
      if (place) this.frame(place, moment);
    }

    frame(place, moment) {
      this.put(this.part("car"), place);
      for (const { shape, track } of [...this.rivals, ...this.bots]) {
        const beside = track.at(Math.max(0, moment));
        if (beside) this.put(shape, beside);
      }
      while (this.waiting.length && this.waiting[0].t <= moment) this.happen(this.waiting.shift());
      if (place.i !== this.step) { this.step = place.i; this.drawTail(place, moment); }
      if (Math.abs(moment - this.drawnAt) >= FIGURES_MS) this.figures(place, moment);
      this.tell("frame", { moment, ...place });
    }

    figures(place, moment) {
      this.drawnAt = moment;
      const end = this.car.t[this.car.t.length - 1];
      const at = Math.max(0, Math.min(moment, end)); // of what the car does: where nothing comes, it stands
      this.write("clock", clock(at - this.lapFrom));
      this.write("lap-number", String(place.lap));
      this.write("speed", `${place.v.toFixed(1)} m/s`);
      this.write("steer", `${place.steer.toFixed(0)}°`.replace("-", "−"));
    }

    // The other cars of a duel, and the bots of the race.
    rival(at) { return this.beside(this.rivals, at, "rival"); }

    bot(at) { return this.beside(this.bots, at, "bot"); }

    beside(others, at, kind) {
      if (!others[at]) {
        const shape = this.part("car").cloneNode(true);
        shape.removeAttribute("data-car");
        shape.setAttribute("hidden", "");
        shape.classList.remove("standing");
        shape.classList.add(kind);
        shape.dataset[kind] = String(at + 1);
        if (this.part("car") !== NONE) this.part("car").before(shape);
        others[at] = { shape, track: new Track() };
      }
      return others[at];
    }

    // By its transform alone: neither style nor layout of anything else is worked out for it, and the map is not drawn anew.
    put(shape, place) {
      if (!this.pixels) return;
      if (shape.hasAttribute("hidden")) shape.removeAttribute("hidden");
      const { scale, x, y } = this.pixels;
      shape.style.transform = `translate(${(x + scale * place.x).toFixed(2)}px,${(y + scale * place.y).toFixed(2)}px) rotate(${place.yaw.toFixed(2)}deg)${"bot" in shape.dataset ? "" : ` translate(${(-scale * NOSE_M).toFixed(2)}px,0)`}`;
      const stands = place.status === "pause";
      if (shape.stands !== stands) { shape.stands = stands; shape.classList.toggle("standing", stands); }
    }

    drawTail(place, moment) {
      const points = [];
      for (let i = place.i; i >= 0 && this.car.t[i] > moment - TAIL_MS; i -= 1) {
        if (i < place.i && Math.hypot(this.car.x[i] - this.car.x[i + 1], this.car.y[i] - this.car.y[i + 1]) > JUMP_M) break;
        points.push(`${this.car.x[i]},${this.car.y[i]}`);
      }
      this.part("tail").setAttribute("points", points.join(" "));
    }

    happen(event) {
      if (event.kind === "lap" && event.car === 0) {
        this.lapFrom = event.t;
        this.write("last-lap", clock(event.ms));
        this.best = Math.min(this.best ?? event.ms, event.ms);
        this.write("best-lap", clock(this.best));
      }
      this.tell("event", event);
    }
  }

  document.querySelectorAll("[data-show]").forEach((root) => { root.show = new Show(root); });
})();
