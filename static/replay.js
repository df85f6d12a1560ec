// Replays a run on its map: play, pause, seek, at 1x to 4x. Reads the columns that the page names in data-replay.
"use strict";

(() => {
  const TAIL_MS = 1500;

  function clock(milliseconds) {
    const minutes = Math.floor(milliseconds / 60000);
    const rest = Math.floor(milliseconds - minutes * 60000);
    return `${minutes}:${String(Math.floor(rest / 1000)).padStart(2, "0")}.${String(rest % 1000).padStart(3, "0")}`;
  }

  class Player {
    constructor(root, run) {
      this.root = root;
      this.run = run;
      this.index = 0;
      this.now = 0;
      this.end = run.t[run.t.length - 1];
      this.part = (name) => root.querySelector(`[data-${name}]`);
      [this.toggle, this.seek, this.rate, this.out, this.car, this.tail] =
        ["toggle", "seek", "rate", "out", "car", "tail"].map(this.part);
      this.laps = this.lapStarts();
      this.seek.max = this.end;
      this.toggle.addEventListener("click", () => (this.frame ? this.pause() : this.play()));
      this.seek.addEventListener("input", () => { this.now = Number(this.seek.value); this.draw(); });
      const box = this.part("stage").viewBox.baseVal;
      this.size = 0.02 * Math.max(box.width, box.height);
      this.car.hidden = false;
      this.car.removeAttribute("hidden");
      this.part("player").hidden = false;
      this.draw();
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
        if (this.now >= this.end || !this.root.isConnected) this.pause();
        else this.frame = requestAnimationFrame(step);
      };
      this.frame = requestAnimationFrame(step);
    }

    pause() {
      cancelAnimationFrame(this.frame);
      this.frame = 0;
      this.toggle.textContent = this.root.dataset.play;
      this.toggle.setAttribute("aria-pressed", "false");
    }

    draw() {
      const { t, x, y, yaw, v, steer, lap, status } = this.run;
      if (t[this.index] > this.now) this.index = 0;
      while (this.index < t.length - 1 && t[this.index + 1] <= this.now) this.index += 1;
      const i = this.index;
      const next = Math.min(i + 1, t.length - 1);
      // A reset moves the car at once: nothing to glide over.
      const jump = Math.hypot(x[next] - x[i], y[next] - y[i]) > 0.6;
      const share = jump || next === i ? 0 : (this.now - t[i]) / (t[next] - t[i]);
      const turn = ((yaw[next] - yaw[i] + 540) % 360) - 180;
      const cx = x[i] + share * (x[next] - x[i]);
      const cy = y[i] + share * (y[next] - y[i]);
      this.car.setAttribute("transform", `translate(${cx} ${cy}) rotate(${yaw[i] + share * turn}) scale(${this.size})`);
      this.car.classList.toggle("standing", status[i] === "pause");
      const points = [`${cx},${cy}`];
      for (let k = i; k >= 0 && this.now - t[k] < TAIL_MS; k -= 1) {
        if (k < i && Math.hypot(x[k] - x[k + 1], y[k] - y[k + 1]) > 0.6) break;
        points.push(`${x[k]},${y[k]}`);
      }
      this.tail.setAttribute("points", points.join(" "));
      this.seek.value = this.now;
      const number = [...this.laps.keys()].indexOf(lap[i]) + 1;
      const inLap = clock(Math.max(0, this.now - this.laps.get(lap[i])));
      const text = `${this.out.dataset.lap} ${number} · ${inLap} · ${v[i].toFixed(1)} m/s · ${steer[i].toFixed(0)}°`;
      this.out.textContent = text;
      this.seek.setAttribute("aria-valuetext", text);
    }
  }

  async function start(root) {
    root.dataset.started = "yes";
    try {
      const answer = await fetch(root.dataset.replay, { headers: { Accept: "application/json" } });
      if (!answer.ok) throw new Error(String(answer.status));
      const run = await answer.json();
      if (run.t.length > 1) new Player(root, run);
    } catch {
      const out = root.querySelector("[data-player]");
      out.hidden = false;
      out.textContent = root.dataset.failed;
    }
  }

  const startAll = () => document.querySelectorAll("[data-replay]:not([data-started])").forEach(start);
  startAll();
  document.addEventListener("htmx:afterSettle", startAll);
})();
