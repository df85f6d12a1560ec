// Plays a live event: the run that is on track, at the same instant for everybody, from poses that come in chunks of half
// a second once they have passed. Time is the server's, measured by round trips against a clock of the browser that only
// counts up: what the reader's own clock says does not matter, and a browser that slept goes on where the show is.
// The element [data-show] hears "show:state" (what the event is), "show:frame" (where the car is) and "show:event"
// (a line crossed, off track, ...), for screens that draw more.
"use strict";

(() => {
  const LOOK_MS = 1000;
  const FETCH_MS = 500;
  const SAMPLES = 8;
  const JUMP_M = 0.6; // a reset moves a car at once: nothing to glide over
  const TAIL_MS = 1500;
  const STILL_MS = 1000;
  const LOST_MS = 30_000;
  const still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

  const clock = (ms) => {
    const whole = Math.max(0, Math.floor(ms));
    return `${Math.floor(whole / 60000)}:${String(Math.floor(whole / 1000) % 60).padStart(2, "0")}.${String(whole % 1000).padStart(3, "0")}`;
  };

  // The server's clock: of the last round trips the shortest says best how far it is off.
  class ServerClock {
    constructor() { this.samples = []; }
    add(sent, received, server) {
      this.samples.push({ trip: received - sent, offset: server - (sent + received) / 2 });
      if (this.samples.length > SAMPLES) this.samples.shift();
      this.offset = this.samples.reduce((best, one) => (one.trip < best.trip ? one : best)).offset;
    }
    now() { return performance.now() + (this.offset ?? 0); }
  }

  // The steps of a car, as they come, and where it is at a moment.
  class Track {
    constructor() { this.t = []; this.x = []; this.y = []; this.yaw = []; this.v = []; this.steer = []; this.lap = []; this.status = []; this.laps = []; this.index = 0; }
    add(columns) {
      // a bot has a place and nothing else
      for (const name of ["t", "x", "y", "yaw", "v", "steer", "lap", "status"]) this[name].push(...(columns[name] || columns.t));
      for (const lap of columns.lap || []) if (!this.laps.includes(lap)) this.laps.push(lap);
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
        yaw: glide ? yaw[i] + share * turn : yaw[i], v: this.v[i], steer: this.steer[i], lap: this.laps.indexOf(this.lap[i]) + 1, status: this.status[i],
      };
    }
  }

  class Show {
    constructor(root) {
      this.root = root;
      this.clock = new ServerClock();
      const none = document.createElement("i"); // a screen shows some of it
      this.part = (name) => root.querySelector(`[data-${name}]`) || none;
      this.Track = Track;
      const map = root.querySelector("svg.overlay");
      const box = map ? map.viewBox.baseVal : { width: 1, height: 1 };
      this.size = 0.025 * Math.max(box.width, box.height);
      this.forget();
      this.look();
      setInterval(() => this.look(), LOOK_MS);
      setInterval(() => this.fetch(), FETCH_MS);
      document.addEventListener("visibilitychange", () => { if (!document.hidden) { this.look(); this.fetch(); } });
      requestAnimationFrame(() => this.draw());
    }

    forget() {
      this.slot = null;
      this.after = -1;
      this.car = new Track();
      [...(this.rivals || []), ...(this.bots || [])].forEach((other) => other.shape.remove());
      this.rivals = [];
      this.bots = [];
      this.waiting = [];
      this.best = null;
      this.lapFrom = 0;
      this.over = false;
    }

    tell(name, detail) { this.root.dispatchEvent(new CustomEvent(`show:${name}`, { detail, bubbles: true })); }

    async ask(address) {
      const sent = performance.now();
      const answer = await fetch(address, { headers: { Accept: "application/json" }, cache: "no-store" });
      if (!answer.ok) throw new Error(String(answer.status));
      const data = await answer.json();
      this.clock.add(sent, performance.now(), data.now);
      return data;
    }

    async look() {
      if (document.hidden || this.looking) return;
      this.looking = true;
      try {
        const state = await this.ask(this.root.dataset.show);
        const seen = JSON.stringify({ ...state, now: 0, reactions: 0 });
        if (this.seen !== undefined && this.seen !== seen && window.htmx) htmx.trigger(document.body, "paddock:show");
        this.seen = seen;
        this.state = state;
        this.take(state.current);
        this.tell("state", state);
      } catch { /* the next look is soon */ } finally { this.looking = false; }
    }

    take(current) {
      const id = current && current.slot;
      if (id && id === (this.slot && this.slot.slot)) { this.slot = current; return; }
      if (!id) {
        // what is left of a run that is over is played to its end; a launch that was undone is gone at once
        if (this.slot && (this.clock.now() < this.slot.starts_at || this.isPlayed())) this.clear();
        return;
      }
      this.forget();
      this.slot = current;
      this.part("stage-card").hidden = !this.state || !["running", "paused"].includes(this.state.phase);
      this.part("who").textContent = current ? current.racer : "–";
      this.part("last-lap").textContent = this.part("best-lap").textContent = "–";
      this.part("tail").setAttribute("points", "");
    }

    // Whether there is nothing left to play: it was, or nothing came for long.
    isPlayed() {
      const end = this.car.t[this.car.t.length - 1] ?? 0;
      const moment = this.clock.now() - this.slot.starts_at - this.state.behind_ms;
      return (this.over && moment > end + 500) || moment > end + LOST_MS;
    }

    // Nobody is on track.
    clear() {
      this.forget();
      this.part("car").setAttribute("hidden", "");
      this.part("ghost").setAttribute("hidden", "");
      this.part("tail").setAttribute("points", "");
      this.part("clock").textContent = "";
      this.part("who").textContent = this.root.dataset.nobody;
      for (const name of ["lap-number", "speed", "steer", "last-lap", "best-lap"]) this.part(name).textContent = "–";
      this.tell("state", this.state);
    }

    async fetch() {
      if (!this.slot || this.over || this.fetching || this.clock.now() < this.slot.starts_at) return;
      this.fetching = true;
      const of = this.slot.slot;
      try {
        for (let more = true; more;) {
          const said = await this.ask(`${this.root.dataset.poses}?slot=${of}&after=${this.after}`);
          if (!this.slot || this.slot.slot !== of) return;
          for (const chunk of said.chunks) {
            if (chunk.n <= this.after) continue;
            this.after = chunk.n;
            if (chunk.cars[0]) this.car.add(chunk.cars[0]);
            chunk.cars.slice(1).forEach((columns, at) => this.rival(at).track.add(columns));
            // bots have a place for each step of the first car's
            chunk.bots.forEach((columns, at) => this.bot(at).track.add({ ...columns, t: chunk.cars[0].t.slice(0, columns.x.length) }));
            this.waiting.push(...chunk.events);
          }
          this.over = said.over;
          more = said.chunks.length >= 100; // somebody came late: the rest at once
        }
      } catch { /* asked again soon */ } finally { this.fetching = false; }
    }

    draw() {
      requestAnimationFrame(() => this.draw());
      if (!this.slot || !this.state) return;
      let moment = this.clock.now() - this.slot.starts_at - this.state.behind_ms;
      if (still()) moment = Math.floor(moment / STILL_MS) * STILL_MS; // from place to place, without gliding
      const soon = this.slot.starts_at - this.clock.now();
      if (soon > 0) {
        this.part("clock").textContent = this.root.dataset.soon.replace("%s", String(Math.ceil(soon / 1000)));
        return;
      }
      if (!this.state.current && this.isPlayed()) { this.clear(); return; }
      const place = this.car.at(Math.max(0, moment));
      const shape = this.part("car");
      if (!place) return;
      this.put(shape, place);
      for (const other of [...this.rivals, ...this.bots]) {
        const beside = other.track.at(Math.max(0, moment));
        if (beside) this.put(other.shape, beside);
      }
      while (this.waiting.length && this.waiting[0].t <= moment) this.happen(this.waiting.shift());
      const end = this.car.t[this.car.t.length - 1];
      const at = Math.max(0, this.over ? Math.min(moment, end) : moment);
      this.part("clock").textContent = clock(at - this.lapFrom);
      this.part("lap-number").textContent = String(place.lap);
      this.part("speed").textContent = `${place.v.toFixed(1)} m/s`;
      this.part("steer").textContent = `${place.steer.toFixed(0)}°`;
      this.drawTail(place, moment);
      this.tell("frame", { moment, ...place });
    }

    // The other cars of a duel.
    rival(at) {
      if (!this.rivals[at]) {
        const shape = this.part("car").cloneNode(true);
        shape.removeAttribute("data-car");
        shape.setAttribute("hidden", "");
        shape.classList.add("rival");
        shape.dataset.rival = String(at + 1);
        this.part("car").before(shape);
        this.rivals[at] = { shape, track: new Track() };
      }
      return this.rivals[at];
    }

    bot(at) {
      if (!this.bots[at]) {
        const shape = this.part("car").cloneNode(true);
        shape.removeAttribute("data-car");
        shape.setAttribute("hidden", "");
        shape.classList.add("bot");
        this.part("bots").append(shape);
        this.bots[at] = { shape, track: new Track() };
      }
      return this.bots[at];
    }

    put(shape, place) {
      shape.removeAttribute("hidden");
      shape.setAttribute("transform", `translate(${place.x} ${place.y}) rotate(${place.yaw}) scale(${this.size})`);
      shape.classList.toggle("standing", place.status === "pause");
    }

    drawTail(place, moment) {
      const points = [];
      for (let i = place.i; i >= 0 && this.car.t[i] > moment - TAIL_MS; i -= 1) {
        if (i < place.i && Math.hypot(this.car.x[i] - this.car.x[i + 1], this.car.y[i] - this.car.y[i + 1]) > JUMP_M) break;
        points.push(`${this.car.x[i]},${this.car.y[i]}`);
      }
      this.part("tail").setAttribute("points", `${place.x},${place.y} ${points.join(" ")}`);
    }

    happen(event) {
      if (event.kind === "lap" && event.car === 0) {
        this.lapFrom = event.t;
        this.part("last-lap").textContent = clock(event.ms);
        this.best = Math.min(this.best ?? event.ms, event.ms);
        this.part("best-lap").textContent = clock(this.best);
      }
      this.tell("event", event);
    }
  }

  document.querySelectorAll("[data-show]").forEach((root) => { root.show = new Show(root); });
})();
