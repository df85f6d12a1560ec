// Charts of laps side by side, over distance or time, beside a replay: they share their moment with its player. The page
// has the rest (mini-sectors, losses, tables) from the server; uPlot draws.

import { listenToFingers } from "./telemetry-fingers.js";
import { clock, evenly, number, span, valueAt } from "./telemetry-values.js";

const HEIGHT = { speed: 190, delta: 130, steer: 130, offset: 110, curvature: 110, reward: 110 };
const CHARTS = [
  { name: "delta", of: [["delta_ms"]], digits: 3, unit: "s" },
  { name: "speed", of: [["driven_speed"], ["speed", true]], digits: 1, unit: "m/s" },
  { name: "steer", of: [["driven_steer"], ["steer", true]], digits: 0, unit: "°" },
  { name: "offset", of: [["offset"]], digits: 2, unit: "m" },
  { name: "curvature", of: [["curvature"]], digits: 1, unit: "1/m" },
  { name: "reward", of: [["reward"]], digits: 2, unit: "" },
];
const REFERENCE = "reference";
const GRID = "rgb(128 128 128 / .25)"; // on either ground
const SYMMETRIC = new Set(["steer", "offset", "curvature"]);
const LEAST_SHARE = 1 / 60; // of a lap, the closest zoom

class Telemetry {
  constructor(root, replay, player, words, data, url) {
    const [run] = replay.runs;
    const others = data.runs.slice(1);
    const isAlone = others.every((each) => each.run === REFERENCE);
    Object.assign(this, { root, replay, player, words, data, url, axis: "metres", plots: [], place: null });
    this.reference = isAlone && others.length ? 1 : 0;
    this.part = (name) => root.querySelector(`[data-${name}]`);
    if (this.part("reference")) this.part("reference").value = this.reference;
    // a run that plays from its start to its end: its charts show the lap that it drives
    if (isAlone && run?.lap === 0 && run.laps.length > 1) this.offerLaps(run.laps);
    this.commanded = this.part("commanded").checked;
    this.part("charts").hidden = false;
    this.box = this.part("plots");
    this.listen();
    this.build();
    // a canvas does not follow the page's theme
    this.theme = matchMedia("(prefers-color-scheme: dark)");
    this.recoloured = () => { this.build(); this.showCursor(); };
    this.theme.addEventListener("change", this.recoloured);
    this.themed = new MutationObserver(this.recoloured);
    this.themed.observe(document.documentElement, { attributes: true, attributeFilter: ["data-theme"] });
    this.resized = new ResizeObserver(() => this.resize());
    this.resized.observe(this.box);
    this.time = () => this.follow();
    player.addEventListener("time", this.time);
    this.follow();
  }

  // --- data --------------------------------------------------------------------------------------------------------
  // The charts' common axis, and a run's channel on it. Over time each run has its own clock.
  get places() {
    const { metres, runs } = this.data;
    if (this.axis === "metres") return metres;
    const last = Math.max(...runs.map((run) => run.ms.findLast((ms) => ms !== null) ?? 0));
    return metres.map((_, i) => (last * i) / (metres.length - 1) / 1000);
  }

  channel(run, name) {
    const values = name === "delta_ms" ? this.delta(run) : run[name];
    if (!values || this.axis === "metres") return values;
    return this.places.map((s) => valueAt(run.ms, values, s * 1000));
  }

  delta(run) {
    const other = this.data.runs[this.reference].ms;
    return run.ms.map((ms, i) => (ms === null || other[i] === null ? null : (ms - other[i]) / 1000));
  }

  // --- the lap ---------------------------------------------------------------------------------------------------------
  offerLaps(laps) {
    const complete = laps.filter((lap) => lap.complete);
    this.best = complete.reduce((best, lap) => (lap.time_ms < (best?.time_ms ?? Infinity) ? lap : best), null)?.number;
    this.known = new Map([[this.data.runs[0].lap, this.data]]);
    const select = this.part("lap");
    select.append(...laps.map(({ number: lap, time_ms: ms }) => new Option(`${this.lapName(lap)} · ${clock(ms)}`, lap)));
    select.value = this.data.runs[0].lap;
    select.addEventListener("change", () => {
      this.player.pause();
      this.player.seek(laps.find(({ number: lap }) => lap === Number(select.value)).start_ms - this.replay.runs[0].start + 1);
    });
    this.part("laps").hidden = false;
  }

  lapName(lap) { return (lap === this.best ? this.words.best_lap : this.words.some_lap).replace("%s", lap); }

  // The lap that the replay has come to, once it has begun.
  async followLap() {
    const lap = this.player.now > 0 ? this.replay.runs[0].lapAt(this.player.now + this.replay.runs[0].start)?.number : undefined;
    if (!this.known || lap === undefined || lap === this.wanted || (this.wanted === undefined && lap === this.data.runs[0].lap)) return;
    this.wanted = lap;
    if (!this.known.has(lap)) {
      this.known.set(lap, null); // request an unreadable lap once
      const url = new URL(this.url, location.href);
      url.searchParams.set("lap", lap);
      const answer = await fetch(url, { headers: { Accept: "application/json" } }).catch(() => ({ ok: false }));
      if (answer.ok) this.known.set(lap, await answer.json());
    }
    if (this.wanted === lap && this.known.get(lap)) this.showLap(this.known.get(lap));
  }

  // Rewards take the server a while, so they come after all else.
  async addRewards() {
    this.url = `${this.url}&reward=1`;
    const note = this.part("rewards");
    [note.hidden, note.textContent] = [false, this.words.rewarding];
    const answer = await fetch(this.url, { headers: { Accept: "application/json" } }).catch(() => ({ ok: false }));
    const found = await answer.json?.().catch(() => null);
    note.hidden = answer.ok;
    if (!answer.ok) { note.textContent = found?.detail ?? this.words.unrewarded; return; }
    this.known?.set(found.runs[0].lap, found);
    if (found.runs[0].lap !== this.data.runs[0].lap) return; // the replay has come to another lap
    this.data = found;
    this.build();
    this.follow();
  }

  showLap(data) {
    this.data = data;
    const [run] = data.runs;
    this.part("shown-lap").textContent = this.lapName(run.lap);
    this.part("lap").value = run.lap;
    const csv = new URL(this.csv ??= this.part("csv").href);
    csv.searchParams.set("lap", run.lap);
    this.csv = csv.href;
    const cells = this.part("of-lap").parentElement.cells;
    [cells[1].textContent, cells[2].textContent] = [run.lap, clock(run.time_ms)];
    this.showSectors();
    this.showLosses();
    if (this.axis === "time") this.range = undefined;
    this.build();
    this.linkCsv();
    this.follow();
  }

  showSectors() {
    const rows = this.root.querySelectorAll(".mini-sectors tbody tr");
    this.data.sectors.forEach(({ times, colours }, at) => rows.forEach((row, run) => {
      const cell = row.querySelectorAll(".sector-time")[at];
      cell.textContent = times[run] === null ? "–" : (times[run] / 1000).toFixed(3);
      cell.className = `sector-time ${colours[run]}`;
    }));
    this.labelSectors();
  }

  showLosses() {
    const { losses, against, runs: [run, other] } = this.data;
    const box = this.part("losses");
    box.hidden = !against;
    if (!against) return;
    const text = other ? this.words.against : this.words.against_best;
    const values = { name: run.name, lap: run.lap, other: other?.name, other_lap: against.lap };
    this.part("against").textContent = text.replace(/%\((\w+)\)s/g, (_, name) => values[name]);
    box.querySelector("ol").replaceChildren(...losses.map(({ sentence, t_ms: ms }) => {
      const [line, link] = [document.createElement("li"), document.createElement("a")];
      link.href = `?lap=${run.lap}&t=${(ms / 1000).toFixed(2)}`;
      link.dataset.moment = ms;
      link.textContent = sentence;
      line.append(link);
      return line;
    }));
    this.part("no-loss").hidden = losses.length > 0;
  }

  // --- charts --------------------------------------------------------------------------------------------------------
  build() {
    for (const { plot } of this.plots) plot.destroy();
    this.box.replaceChildren();
    const { runs } = this.data;
    this.colours = runs.map((run, at) => this.colour(run, at));
    const x = this.places;
    this.range ??= [x[0], x[x.length - 1]];
    this.whole = [x[0], x[x.length - 1]];
    this.plots = [];
    for (const chart of CHARTS) {
      if (chart.name === "delta" && runs.length < 2) continue;
      if (chart.name === "reward" && !runs.some((run) => run.reward)) continue;
      const series = [{}];
      const columns = [x];
      for (const [name, isCommand] of chart.of) {
        if (isCommand && !this.commanded) continue;
        runs.forEach((run, at) => {
          const values = this.channel(run, name);
          if (!values) return;
          columns.push(values);
          series.push({ stroke: this.colours[at], width: isCommand ? 1 : at ? 1.5 : 2, dash: isCommand ? [4, 4] : undefined, alpha: isCommand ? 0.75 : 1, points: { show: false } });
        });
      }
      const figure = document.createElement("figure");
      const caption = document.createElement("figcaption");
      const hint = { delta: this.words.later, steer: this.words.left, offset: this.words.left, curvature: this.words.left }[chart.name];
      caption.textContent = `${this.words[chart.name]}${chart.unit ? `, ${chart.unit}` : ""}${hint ? ` (${hint})` : ""}`;
      figure.append(caption);
      figure.dataset.chart = chart.name;
      this.box.append(figure);
      const plot = new uPlot(this.options(chart, series), columns, figure);
      listenToFingers(plot, this);
      this.plots.push({ chart, plot });
    }
  }

  // A run has the colour of its car in the replay, as far from the ground as the text is.
  colour({ run }, at) {
    const look = this.replay.runs.find((each) => each.run === run)?.look;
    const samples = this.root.querySelectorAll(`.t${at}`);
    if (look) samples.forEach((sample) => { sample.style.background = `color-mix(in srgb, ${look.colour} 78%, var(--text))`; });
    return getComputedStyle(samples[0]).backgroundColor;
  }

  options({ name, digits }, series) {
    const style = getComputedStyle(this.root);
    const text = style.color;
    const axis = { stroke: text, grid: { stroke: GRID, width: 1 }, ticks: { show: false }, font: `12px ${style.fontFamily}` };
    return {
      width: Math.max(200, this.box.clientWidth), height: HEIGHT[name], series, legend: { show: false },
      scales: { x: { time: false, range: () => this.range }, y: { range: (u, low, high) => span(name, low, high) } },
      axes: [
        { ...axis, size: 24, values: (u, ticks) => ticks.map((tick) => `${+tick.toFixed(2)}`) },
        { ...axis, size: 50, space: 20, ...(SYMMETRIC.has(name) && { splits: (u, at, low, high) => evenly(high) }), values: (u, ticks) => ticks.map((tick) => tick.toFixed(Math.abs(tick) < 10 ? Math.max(digits, tick % 1 ? 1 : 0) : Math.min(digits, 1)).replace("-", "−")) },
      ],
      cursor: { y: false, drag: { x: true, y: false, setScale: false }, points: { size: 6 } },
      hooks: {
        drawClear: [(u) => this.drawTurns(u, text)],
        setSelect: [(u) => this.select(u)],
        setCursor: [(u) => this.point(u)],
      },
    };
  }

  // The turns behind the lines, with their numbers.
  drawTurns(u, text) {
    const { ctx, bbox } = u;
    const [run] = this.data.runs;
    const place = (metres) => (this.axis === "metres" ? metres : (valueAt(this.data.metres, run.ms, metres) ?? 0) / 1000);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const { number: name, from_m: from, to_m: to, apex_m: apex } of this.data.turns) {
      for (const [a, b] of from < to ? [[from, to]] : [[from, this.data.length_m], [0, to]]) {
        const [left, right] = [a, b].map((metres) => u.valToPos(place(metres), "x", true));
        ctx.fillStyle = text;
        ctx.globalAlpha = 0.06;
        ctx.fillRect(left, bbox.top, right - left, bbox.height);
        if (!(apex >= a && apex <= b)) continue;
        ctx.globalAlpha = 0.7;
        ctx.font = `${11 * devicePixelRatio}px ${getComputedStyle(this.root).fontFamily}`;
        ctx.textAlign = "center";
        ctx.fillText(String(name), u.valToPos(place(apex), "x", true), bbox.top + 11 * devicePixelRatio);
      }
    }
    ctx.restore();
  }

  resize() {
    const width = Math.max(200, this.box.clientWidth);
    for (const { chart, plot } of this.plots) if (plot.width !== width) plot.setSize({ width, height: HEIGHT[chart.name] });
    this.showCursor();
  }

  // --- zoom ------------------------------------------------------------------------------------------------------------
  show(from, to) {
    const [first, last] = this.whole;
    const least = (last - first) * LEAST_SHARE;
    const size = Math.min(Math.max(to - from, least), last - first);
    const begin = Math.min(Math.max((from + to - size) / 2, first), last - size);
    this.range = [begin, begin + size];
    if (this.chosen) { this.chosen = null; this.labelSectors(); }
    for (const { plot } of this.plots) plot.setScale("x", { min: this.range[0], max: this.range[1] });
    this.showCursor();
    this.linkCsv();
  }

  zoom(how) {
    const [from, to] = this.range;
    const size = to - from;
    const middle = this.place >= from && this.place <= to ? this.place : (from + to) / 2;
    const around = (factor) => [middle - (middle - from) * factor, middle + (to - middle) * factor];
    const ranges = {
      in: () => around(0.5), out: () => around(2), all: () => this.whole,
      "pan-back": () => [from - size / 3, to - size / 3], "pan-on": () => [from + size / 3, to + size / 3],
    };
    this.show(...ranges[how]());
  }

  // The file has the metres that are shown.
  linkCsv() {
    const link = this.part("csv");
    const url = new URL(this.csv ??= link.href);
    const isWhole = this.range[0] <= this.whole[0] && this.range[1] >= this.whole[1];
    if (!isWhole) {
      const at = (value) => (this.axis === "metres" ? value : valueAt(this.data.runs[0].ms, this.data.metres, value * 1000) ?? this.data.length_m);
      url.searchParams.set("from", at(this.range[0]).toFixed(2));
      url.searchParams.set("to", at(this.range[1]).toFixed(2));
    }
    link.href = url;
  }

  select(u) {
    if (u.select.width < 4) return;
    const [from, to] = [u.select.left, u.select.left + u.select.width].map((left) => u.posToVal(left, "x"));
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.show(from, to);
  }

  // --- cursor ----------------------------------------------------------------------------------------------------------
  // The player's moment as a place on the axis: of the first run's lap.
  follow() {
    this.followLap();
    const ms = this.player.now + (this.replay.runs[0]?.start ?? 0) - this.data.runs[0].start_ms;
    const [run] = this.data.runs;
    const last = run.ms.findLast((each) => each !== null) ?? 0;
    this.place = ms < -1 || ms > last + 1 ? null : this.axis === "time" ? ms / 1000 : valueAt(run.ms, this.data.metres, Math.min(Math.max(ms, 0), last));
    this.showCursor();
  }

  // uPlot takes new scales and sizes over in a microtask, before this one.
  showCursor() {
    queueMicrotask(() => this.placeCursors());
    this.showValues();
  }

  placeCursors() {
    for (const { plot } of this.plots) {
      const left = this.place === null ? -10 : plot.valToPos(this.place, "x");
      plot.setCursor({ left, top: left < 0 ? -10 : 0 }, false); // without an event
    }
  }

  // A chart's cursor was moved by the pointer: the replay goes there unless it plays.
  point(u) {
    // uPlot says so too after a change of its size, of a pointer that is elsewhere
    if (this.player.playing || u.cursor.left < 0 || !u.over.matches(":hover")) return;
    this.goTo(u.posToVal(u.cursor.left, "x"));
  }

  goTo(place) {
    const [run] = this.data.runs;
    const last = run.ms.findLastIndex((each) => each !== null);
    const end = this.axis === "time" ? run.ms[last] / 1000 : this.data.metres[last]; // its own, not that of a slower run
    const at = Math.min(Math.max(place, this.whole[0]), end);
    const ms = this.axis === "time" ? at * 1000 : valueAt(this.data.metres, run.ms, at);
    if (ms !== null) this.player.seek(ms + run.start_ms - (this.replay.runs[0]?.start ?? 0));
  }

  showValues() {
    const { runs, metres, turns } = this.data;
    const rows = this.root.querySelectorAll(".telemetry-values tbody tr");
    const at = this.place;
    const [run] = runs;
    const way = at === null ? null : this.axis === "metres" ? at : valueAt(run.ms, metres, at * 1000);
    const inside = way === null ? null : turns.find(({ from_m: from, to_m: to }) => (from < to ? way >= from && way < to : way >= from || way < to));
    this.part("place").textContent = way === null ? "" : `${way.toFixed(1)} m${inside ? ` · ${this.words.turn} ${inside.number}` : ""}`;
    runs.forEach((each, index) => {
      const [keys, key] = this.axis === "metres" ? [metres, at] : [each.ms, at === null ? null : at * 1000];
      const value = (values) => (key === null ? null : valueAt(keys, values, key));
      const delta = value(this.delta(each));
      const texts = [
        clock(value(each.ms)),
        ...(runs.length > 1 ? [index === this.reference || delta === null ? "" : `${delta < 0 ? "−" : "+"}${Math.abs(delta).toFixed(3)}`] : []),
        number(value(each.driven_speed), 2), number(value(each.driven_steer), 0), number(value(each.offset), 2),
      ];
      texts.forEach((text, cell) => { rows[index].cells[cell + 1].textContent = text; });
    });
  }

  // --- what the reader does ----------------------------------------------------------------------------------------------
  listen() {
    this.part("axis").addEventListener("change", ({ target }) => {
      this.axis = target.value;
      this.range = undefined;
      this.build();
      this.follow();
      this.linkCsv();
    });
    this.part("reference")?.addEventListener("change", ({ target }) => { this.reference = Number(target.value); this.build(); this.showCursor(); });
    this.part("commanded").addEventListener("change", ({ target }) => { this.commanded = target.checked; this.build(); this.showCursor(); });
    this.root.querySelectorAll("[data-zoom]").forEach((button) => button.addEventListener("click", () => this.zoom(button.dataset.zoom)));
    this.box.addEventListener("keydown", (event) => this.press(event));
    this.box.addEventListener("dblclick", () => this.zoom("all"));
    this.box.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      this.zoom(event.deltaY < 0 ? "in" : "out");
    }, { passive: false });
    this.listenToSectors();
    this.part("losses").addEventListener("click", (event) => {
      const link = event.target.closest("a[data-moment]");
      if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
      event.preventDefault();
      this.player.pause();
      this.player.seek(Number(link.dataset.moment) + this.data.runs[0].start_ms - (this.replay.runs[0]?.start ?? 0));
      document.querySelector("[data-stage]")?.scrollIntoView({ block: "center" });
    });
  }

  // A mini-sector shows its metres alone, and again the whole lap. One of them is in the order of tabs; arrows go on.
  listenToSectors() {
    this.cells = [...this.root.querySelectorAll(".sector-time[data-from]")];
    const wide = this.data.sectors.length;
    const reach = (cell) => { for (const each of this.cells) each.tabIndex = each === cell ? 0 : -1; };
    const choose = (cell) => {
      const isChosen = cell.getAttribute("aria-pressed") === "true";
      const place = (metres) => (this.axis === "metres" ? metres : (valueAt(this.data.metres, this.data.runs[0].ms, metres) ?? 0) / 1000);
      this.show(...(isChosen ? this.whole : [cell.dataset.from, cell.dataset.to].map((metres) => place(Number(metres)))));
      this.chosen = isChosen ? null : cell;
      this.labelSectors();
    };
    for (const cell of this.cells) {
      cell.setAttribute("role", "button");
      cell.addEventListener("click", () => { reach(cell); choose(cell); });
      cell.addEventListener("keydown", (event) => {
        if (event.ctrlKey || event.metaKey || event.altKey) return;
        const by = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -wide, ArrowDown: wide }[event.key];
        const next = this.cells[this.cells.indexOf(cell) + by];
        if (next) { reach(next); next.focus(); } else if (["Enter", " "].includes(event.key)) choose(cell);
        if (next || by || ["Enter", " "].includes(event.key)) event.preventDefault();
      });
    }
    reach(this.cells[0]);
    this.labelSectors();
  }

  labelSectors() {
    const word = this.root.querySelector(".mini-sectors").dataset.word;
    this.cells.forEach((cell, at) => {
      cell.setAttribute("aria-label", `${word} ${(at % this.data.sectors.length) + 1}: ${cell.textContent}`);
      cell.setAttribute("aria-pressed", String(cell === this.chosen));
    });
  }

  press(event) {
    const { key, shiftKey } = event;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const [from, to] = this.range;
    const step = (this.whole[1] - this.whole[0]) / (this.data.metres.length - 1) * (shiftKey ? 10 : 1);
    const move = (by) => () => {
      const place = (this.place ?? from) + by;
      if (place < from || place > to) this.show(place - (to - from) / 2, place + (to - from) / 2);
      this.player.pause();
      this.goTo(place);
    };
    const acts = {
      ArrowLeft: move(-step), ArrowRight: move(step), Home: () => this.goTo(this.whole[0]), End: () => this.goTo(this.whole[1]),
      "+": () => this.zoom("in"), "=": () => this.zoom("in"), "-": () => this.zoom("out"), "0": () => this.zoom("all"),
      PageUp: () => this.zoom("pan-back"), PageDown: () => this.zoom("pan-on"),
    };
    if (!acts[key]) return;
    event.preventDefault();
    event.stopPropagation();
    acts[key]();
  }

  dispose() {
    this.player.removeEventListener("time", this.time);
    this.resized.disconnect();
    this.themed.disconnect();
    this.theme.removeEventListener("change", this.recoloured);
    for (const { plot } of this.plots) plot.destroy();
  }
}

function load(src) {
  return new Promise((done, failed) => {
    document.head.append(Object.assign(document.createElement("script"), { src, onload: done, onerror: failed }));
  });
}

// The charts in `root` (templates/races/telemetry/panel.html) for a replay and its player.
export async function createTelemetry(root, replay, player) {
  const { url, plot, rewarded, words } = JSON.parse(root.dataset.telemetry);
  const [answer] = await Promise.all([fetch(url, { headers: { Accept: "application/json" } }), "uPlot" in window || load(plot)]);
  if (!answer.ok) throw Object.assign(new Error(words.failed), { status: answer.status });
  const telemetry = new Telemetry(root, replay, player, words, await answer.json(), url);
  root.telemetry = telemetry;
  if (rewarded) telemetry.addRewards();
  root.dispatchEvent(new CustomEvent("telemetry:ready", { bubbles: true, detail: telemetry }));
  return telemetry;
}

function join(viewer) {
  const root = document.querySelector("[data-telemetry]:not([data-started])");
  if (!root) return;
  root.dataset.started = "yes";
  createTelemetry(root, viewer.replay, viewer.player).catch((error) => {
    if (!("status" in error)) throw error;
    const note = document.createElement("p");
    note.className = "pad";
    note.setAttribute("role", "status");
    note.textContent = error.message;
    root.querySelector(".card-head").after(note);
  });
}

document.addEventListener("viewer:ready", ({ detail }) => join(detail));
const ready = [...document.querySelectorAll("[data-viewer]")].find((root) => root.viewer);
if (ready) join(ready.viewer);
