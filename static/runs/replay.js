// Replays a run on its map at 1x to 8x with bots and rivals, from the columns named in data-replay; a run that ends
// while its page is open starts by itself and stops at its result.
"use strict";

(() => {
  const TAIL_MS = 1500;

  function clock(milliseconds) {
    const minutes = Math.floor(milliseconds / 60000);
    const rest = Math.floor(milliseconds - minutes * 60000);
    return `${minutes}:${String(Math.floor(rest / 1000)).padStart(2, "0")}.${String(rest % 1000).padStart(3, "0")}`;
  }

  // A reset moves a car at once: nothing to glide over.
  const JUMP_M = 0.6;
  // A trace has the car's nose, which is so far before its middle. Of a bot it has the middle.
  const NOSE_M = 0.14;
  const SVG = "http://www.w3.org/2000/svg";

  // Where a car is at `share` between steps i and next of its columns: [x, y, degrees].
  function between({ x, y, yaw }, i, next, share) {
    if (next === i || Math.hypot(x[next] - x[i], y[next] - y[i]) > JUMP_M) return [x[i], y[i], yaw[i]];
    const turn = ((yaw[next] - yaw[i] + 540) % 360) - 180;
    return [x[i] + share * (x[next] - x[i]), y[i] + share * (y[next] - y[i]), yaw[i] + share * turn];
  }

  // The last step of the columns at or before a moment, looked for from step `from` on.
  function stepAt(t, moment, from) {
    let index = t[from] > moment ? 0 : from;
    while (index < t.length - 1 && t[index + 1] <= moment) index += 1;
    return index;
  }

  const SEEN_MS = 350; // between two frames of what the car saw

  class Player {
    constructor(root, run) {
      this.root = root;
      this.run = run;
      this.index = 0;
      this.now = 0;
      // The replay goes on until the last car is done.
      this.end = Math.max(...[run, ...run.rivals].map(({ t }) => t[t.length - 1] ?? 0));
      this.part = (name) => root.querySelector(`[data-${name}]`);
      [this.toggle, this.seek, this.rate, this.out, this.tail] =
        ["toggle", "seek", "rate", "out", "tail"].map(this.part);
      this.car = root.querySelector('[data-car="0"]');
      this.laps = this.lapStarts();
      this.seen = this.part("seen");
      this.saw = this.part("saw");
      this.seek.max = this.end;
      this.toggle.addEventListener("click", () => (this.frame ? this.pause() : this.play()));
      this.seek.addEventListener("input", () => { this.now = Number(this.seek.value); this.draw(); });
      const box = this.part("stage").viewBox.baseVal;
      this.size = 0.025 * Math.max(box.width, box.height);
      // Bots have a place for each step of the car's own; rivals have steps of their own.
      this.others = [
        ...run.bots.map((columns) => this.other({ t: run.t, ...columns }, this.bot())),
        ...run.rivals.map((columns) => this.other(columns, root.querySelector(`[data-car="${columns.number}"]`))),
      ];
      this.car.removeAttribute("hidden");
      this.part("player").hidden = false;
      this.draw();
    }

    bot() {
      const shape = document.createElementNS(SVG, "g");
      shape.setAttribute("class", "replay-bot");
      shape.append(this.part("bot").cloneNode());
      this.part("others").append(shape);
      return shape;
    }

    other(columns, shape) {
      shape.removeAttribute("hidden");
      return { columns, shape, index: 0 };
    }

    put(shape, [x, y, degrees]) {
      const back = shape.classList.contains("replay-bot") ? "" : ` translate(${-NOSE_M} 0)`;
      shape.setAttribute("transform", `translate(${x} ${y}) rotate(${degrees})${back} scale(${this.size})`);
    }

    lapStarts() {
      const starts = new Map();
      this.run.lap.forEach((lap, i) => { if (!starts.has(lap)) starts.set(lap, this.run.t[i]); });
      return starts;
    }

    play() {
      if (this.now >= this.end) this.now = 0;
      this.toggle.textContent = this.root.dataset.pause;
      this.toggle.setAttribute("aria-pressed", "true");
      let before = performance.now();
      const step = (moment) => {
        this.now = Math.min(this.end, this.now + (moment - before) * Number(this.rate.value));
        before = moment;
        this.draw();
        if (this.now >= this.end || !this.root.isConnected) {
          this.pause();
          if (this.watching) this.land();
        }
        else this.frame = requestAnimationFrame(step);
      };
      this.frame = requestAnimationFrame(step);
    }

    // The whole run at 8x, unless the reader takes over or wants nothing to move.
    watch() {
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) { this.land(); return; }
      this.rate.value = "8";
      this.watching = this.watched = true;
      for (const taken of ["pointerdown", "keydown", "wheel", "touchmove"]) {
        addEventListener(taken, () => { this.watched = false; }, { once: true, passive: true });
      }
      this.root.scrollIntoView({ block: "center" });
      this.play();
    }

    land() {
      this.now = this.end;
      this.draw();
      this.rate.value = "1";
      this.out.textContent = this.root.dataset.result;
      this.root.dataset.landed = "";
      if (this.watched) document.getElementById("evaluation").scrollIntoView({ block: "start" });
      this.watching = this.watched = false;
    }

    // The camera frame of the moment: one request at a time, at most one each SEEN_MS, and only while the picture is in sight.
    look() {
      if (!this.seen) return;
      const ms = Math.round(this.now);
      this.saw.href = `${this.saw.href.split("?")[0]}?ms=${ms}`;
      if (this.looking || ms === this.requested) return;
      this.looking = true;
      setTimeout(() => this.loadFrame(), SEEN_MS);
    }

    // A new source aborts the request before it, so the next frame waits until this one has loaded or failed.
    loadFrame() {
      const box = this.root.getBoundingClientRect();
      if (box.bottom < 0 || box.top > innerHeight) { this.looking = false; return; }
      this.requested = Math.round(this.now);
      this.seen.onload = this.seen.onerror = () => { this.looking = false; this.look(); };
      this.seen.hidden = false;
      this.seen.src = `${this.seen.dataset.seen}?ms=${this.requested}`;
    }

    pause() {
      cancelAnimationFrame(this.frame);
      this.frame = 0;
      this.toggle.textContent = this.root.dataset.play;
      this.toggle.setAttribute("aria-pressed", "false");
    }

    draw() {
      const { t, x, y, v, steer, lap, status } = this.run;
      const i = this.index = stepAt(t, this.now, this.index);
      const next = Math.min(i + 1, t.length - 1);
      const place = between(this.run, i, next, next === i ? 0 : (this.now - t[i]) / (t[next] - t[i]));
      const [cx, cy] = place;
      this.put(this.car, place);
      this.car.classList.toggle("standing", status[i] === "pause");
      this.car.classList.toggle("gone", this.now > t[t.length - 1]);
      for (const other of this.others) {
        const { columns } = other;
        if (!columns.x.length) continue;
        const last = Math.min(columns.t.length, columns.x.length) - 1;
        const at = other.index = Math.min(last, stepAt(columns.t, this.now, Math.min(other.index, last)));
        const then = Math.min(at + 1, last);
        const share = then === at ? 0 : (this.now - columns.t[at]) / (columns.t[then] - columns.t[at]);
        this.put(other.shape, between(columns, at, then, share));
        other.shape.classList.toggle("gone", this.now > columns.t[last]);
        if (columns.status) other.shape.classList.toggle("standing", columns.status[at] === "pause");
      }
      const points = [`${cx},${cy}`];
      for (let k = i; k >= 0 && this.now - t[k] < TAIL_MS; k -= 1) {
        if (k < i && Math.hypot(x[k] - x[k + 1], y[k] - y[k + 1]) > JUMP_M) break;
        points.push(`${x[k]},${y[k]}`);
      }
      this.tail.setAttribute("points", points.join(" "));
      this.seek.value = this.now;
      this.look();
      const number = [...this.laps.keys()].indexOf(lap[i]) + 1 + (this.run.before ?? 0);
      const inLap = clock(Math.max(0, Math.min(this.now, t[t.length - 1]) - this.laps.get(lap[i])));
      const text = `${this.out.dataset.lap} ${number} · ${inLap} · ${v[i].toFixed(1)} m/s · ${steer[i].toFixed(0)}°`;
      this.out.textContent = text;
      this.seek.setAttribute("aria-valuetext", text);
    }
  }

  async function start(root, watched) {
    root.dataset.started = "yes";
    try {
      const answer = await fetch(root.dataset.replay, { headers: { Accept: "application/json" } });
      if (!answer.ok) throw new Error(String(answer.status));
      const run = await answer.json();
      if (run.t.length < 2) return;
      const player = new Player(root, run);
      if (watched) player.watch();
    } catch {
      const out = root.querySelector("[data-player]");
      out.hidden = false;
      out.textContent = root.dataset.failed;
    }
  }

  const startAll = (watched) => document.querySelectorAll("[data-replay]:not([data-started])")
    .forEach((root) => start(root, watched));
  startAll(false);
  // it came in the place of the car that was on track
  document.addEventListener("htmx:afterSettle", () => startAll(true));
})();
