// Draws the screens of a live event from the events of live/show.js: timing tower, sectors, the leader's ghost, next
// cars, countdown and podium.
import { Ghost } from "../viewer/live-replay.js";

const COUNT_MS = 200;
const GHOST_MS = 4000; // all pages ask for the ghost of a new leader; before the next start there is time
const LIT_MS = 1800;
const SECTORS = 3;
const SLIDE_MS = 500;
const BEAT_MS = 10000; // so often a screen tells that it is connected
const LOST_MS = 6000; // without any word from the server
const still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
const element = (tag, name, text = "") => {
  const made = document.createElement(tag);
  made.className = name;
  made.textContent = text;
  return made;
};
const time = (ms) => {
  const whole = Math.round(ms);
  const rest = `${String(Math.floor(whole / 1000) % 60).padStart(2, "0")}.${String(whole % 1000).padStart(3, "0")}`;
  return `${Math.floor(whole / 60000)}:${rest}`;
};
const signed = (ms) => `${ms < 0 ? "−" : "+"}${(Math.abs(ms) / 1000).toFixed(3)}`;
const light = (line) => {
  line.classList.add("lit");
  setTimeout(() => line.classList.remove("lit"), LIT_MS);
};
// purple: nobody was as quick; green: the racer never was; yellow: neither
const colour = (ms, best, own) => (best == null || ms <= best ? "best" : own == null || ms <= own ? "own" : "slow");

class Screen {
  constructor(root) {
    this.root = root;
    this.words = root.dataset;
    // the viewer has these parts itself
    this.all = (name) => [...root.querySelectorAll(`[data-${name}]`)].filter((each) => !each.closest("[data-viewer]"));
    this.wheels = this.all("wheel");
    this.forget();
    root.addEventListener("show:state", ({ detail }) => this.state(detail));
    root.addEventListener("show:frame", ({ detail }) => this.frame(detail));
    root.addEventListener("show:again", () => { this.slot = null; });
    root.addEventListener("show:event", ({ detail }) => this.event(detail));
    setInterval(() => this.count(), COUNT_MS);
    if (this.words.beat) { this.beat(); setInterval(() => this.beat(), BEAT_MS); }
  }

  // The console's lamp of this screen is lit as long as it tells that it is there.
  beat() { if (!this.isLost()) fetch(this.words.beat, { cache: "no-store", signal: AbortSignal.timeout(5000) }).catch(() => {}); }

  // Whether neither the stream nor an answer has come for a while.
  isLost() {
    const { streams, toldAt, born } = this.root.show.feed;
    return !streams && performance.now() - Math.max(toldAt, born) > LOST_MS;
  }

  forget() {
    this.slot = null;
    this.inLap = [];
    this.laps = [];
    this.delta(null);
    this.all("sectors").forEach((each) => each.replaceChildren());
  }

  // --- the state -------------------------------------------------------------------------------------------------
  state(told) {
    this.told = told;
    const slot = told.current && `${told.current.slot} ${told.current.starts_at}`; // an interrupted run starts again
    if (slot && slot !== this.slot) { this.forget(); this.slot = slot; }
    if (this.slot && !slot && !this.root.show.slot) this.forget(); // nobody is on track: no sectors are left
    const shows = told.podium.length && !told.current;
    const under = ["running", "paused", "ended"].includes(told.phase);
    this.root.dataset.phase = told.phase === "cancelled" ? "cancelled" : shows ? "podium" : under ? "running" : "before";
    // between two heats a big screen shows the bracket
    this.root.toggleAttribute("data-between", told.drawn && under && !shows && !told.current && !this.root.show.slot);
    this.all("on-track").forEach((each) => { each.hidden = !told.current && !this.root.show.slot; });
    this.all("has-next").forEach((each) => { each.hidden = !told.next.length; });
    this.all("standings-head").forEach((each) => { each.textContent = told.standings.length || under ? this.words.standings : this.words.lobby; });
    this.all("stage-tower").forEach((each) => { each.hidden = !told.standings.length; });
    this.all("has-podium").forEach((each) => { each.hidden = !told.podium.length; });
    this.all("message").forEach((each) => { each.hidden = !told.message || this.root.dataset.phase === "podium"; if (each.textContent !== told.message) each.textContent = told.message; });
    if (!told.current && !this.root.show.slot) this.all("who").forEach((each) => { each.textContent = told.next.length ? this.words.upNext.replace("%s", () => told.next[0].racer) : this.words.nobody; });
    this.all("tower").forEach((each) => this.tower(each));
    this.all("next").forEach((each) => this.next(each));
    this.all("podium").forEach((each) => this.podium(each));
    this.count();
    this.fetchGhost();
  }

  tower(list) {
    const { standings, current, best_sectors: best, own_sectors: own } = this.told;
    const rows = standings.length ? this.withLaps(standings) : this.told.racers.map((racer) => ({ ...racer, rank: null, sectors: [], score_ms: null }));
    const shown = rows.slice(0, Number(list.dataset.most) || rows.length);
    const drives = current && rows.find((row) => row.racer === current.racer);
    if (drives && !shown.includes(drives)) shown[shown.length - 1] = drives;
    const text = JSON.stringify([shown, current && current.racer, best, own]);
    if (text === list.was) return;
    const before = new Map(list.was ? [...list.children].map((row) => [row.dataset.racer, row.getBoundingClientRect().top]) : []);
    const times = list.times || new Map();
    list.was = text;
    list.times = new Map();
    list.replaceChildren(...shown.map((row) => {
      const line = element("li", `${current && current.racer === row.racer ? "driving" : ""}${row.live ? " provisional" : ""}`);
      line.dataset.racer = row.racer;
      const marks = element("span", "marks");
      (row.sectors || []).forEach((ms, at) => marks.append(element("i", colour(ms, best[at], (own[row.racer] || [])[at]))));
      const here = row.here ? this.words.here : "–"; // in the lobby
      const gap = !standings.length ? here : row.points != null ? String(row.points) : row.score_ms == null ? (row.attempts ? this.words.noResult : "–") : row.gap_ms ? signed(row.gap_ms) : time(row.score_ms);
      line.append(element("span", "pos num", row.rank ?? "–"), element("span", "who name", row.racer), marks, element("span", row.here && !standings.length ? "time here" : "time num", gap));
      list.times.set(row.racer, row.score_ms);
      if (times.has(row.racer) && times.get(row.racer) !== row.score_ms) light(line);
      return line;
    }));
    if (still()) return;
    for (const row of list.children) {
      const was = before.get(row.dataset.racer);
      const by = was === undefined ? 0 : was - row.getBoundingClientRect().top;
      if (by) row.animate([{ transform: `translateY(${by}px)` }, { transform: "none" }], { duration: SLIDE_MS, easing: "ease-out" });
    }
  }

  // The standings with the laps of the run on track: a row moves while its car drives.
  withLaps(standings) {
    const { current } = this.told;
    const sectors = this.inLap.length ? [...this.inLap] : null;
    const drives = current && current.cars.length === 1 && standings.find((row) => row.racer === current.racer);
    if (!drives || !this.words.figure) return standings;
    const score = this.score();
    const better = score !== null && (drives.score_ms === null || score < drives.score_ms);
    const now = { ...drives, sectors: sectors ?? drives.sectors, ...(better ? { score_ms: score, live: true } : {}) };
    const rows = standings.map((row) => (row === drives ? now : row));
    if (!better) return rows;
    const placed = rows.filter((row) => row.score_ms !== null && (row.rank !== null || row === now)).sort((a, b) => a.score_ms - b.score_ms);
    const others = rows.filter((row) => !placed.includes(row));
    return [...placed.map((row, at) => ({ ...row, rank: at + 1, gap_ms: row.score_ms - placed[0].score_ms })), ...others];
  }

  // The score of the run's complete laps; null before there are enough, or where only the server computes it.
  score() {
    const needed = Math.max(1, Number(this.words.needed));
    if (this.laps.length < needed) return null;
    if (this.words.figure === "best_lap_ms") return Math.min(...this.laps);
    const sum = (laps) => laps.reduce((all, ms) => all + ms, 0);
    if (this.words.figure === "total_ms") return sum(this.laps.slice(0, needed));
    if (this.words.figure !== "average_ms") return null;
    return Math.min(...this.laps.slice(needed - 1).map((_ms, at) => Math.floor(sum(this.laps.slice(at, at + needed)) / needed)));
  }

  next(list) {
    const text = JSON.stringify(this.told.next);
    if (text === list.was) return;
    list.was = text;
    list.replaceChildren(...this.told.next.map((slot) => {
      const line = element("li", slot.state);
      line.append(element("span", "name", slot.racer), element("small", "", this.words.round.replace("%s", slot.round)));
      if (slot.state === "called") line.append(element("strong", "called", this.words.called));
      return line;
    }));
  }

  podium(list) {
    if ("made" in list.dataset) return; // the server's, with pictures
    const text = this.told.podium.join("\n");
    if (text === list.was) return;
    list.was = text;
    list.replaceChildren(...this.told.podium.map((racer, at) => {
      const line = element("li", `step-${at + 1}`);
      const row = this.told.standings.find((one) => one.racer === racer);
      line.append(element("span", "name", racer), element("span", "num", row && row.score_ms != null ? time(row.score_ms) : ""), element("b", "num", String(at + 1)));
      return line;
    }));
  }

  count() {
    const lost = this.isLost();
    this.all("lost").forEach((each) => { if (each.hidden === lost) each.hidden = !lost; });
    if (!this.told) return;
    const waits = ["planned", "lobby"].includes(this.told.phase);
    const left = Math.max(0, Math.ceil((this.told.starts_at - this.root.show.clock.now()) / 1000));
    const [hours, minutes, seconds] = [Math.floor(left / 3600), Math.floor(left / 60) % 60, left % 60];
    const two = (number) => String(number).padStart(2, "0");
    this.all("countdown").forEach((each) => {
      if (each.hidden === waits) each.hidden = !waits;
      const text = hours ? `${hours}:${two(minutes)}:${two(seconds)}` : `${minutes}:${two(seconds)}`;
      if (waits && each.textContent !== text) each.textContent = text;
    });
  }

  // --- what the car does -----------------------------------------------------------------------------------------
  frame({ steer }) {
    if (steer === this.steer) return;
    this.steer = steer;
    this.wheels.forEach((each) => { each.style.transform = `rotate(${-steer * 2}deg)`; });
  }

  event(event) {
    if (event.car !== 0 || !this.told) return;
    if (event.kind === "lap") {
      this.laps.push(event.ms);
      this.all("tower").forEach((each) => this.tower(each));
      this.inLap = [];
    }
    if (event.kind !== "sector") return;
    if (event.sector === 1 || this.inLap.length >= SECTORS) { this.inLap = []; this.all("sectors").forEach((each) => each.replaceChildren()); }
    this.inLap.push(event.ms);
    const { best_sectors: best, own_sectors: own, current, leader } = this.told;
    const mine = (current && own[current.racer]) || [];
    const at = event.sector - 1;
    this.all("sectors").forEach((each) => each.append(element("li", colour(event.ms, best[at], mine[at]), (event.ms / 1000).toFixed(3))));
    best[at] = Math.min(best[at] ?? event.ms, event.ms);
    if (current) { (own[current.racer] ??= [])[at] = Math.min(mine[at] ?? event.ms, event.ms); }
    if (leader && leader.sectors.length > at) {
      const sum = (times) => times.slice(0, event.sector).reduce((all, ms) => all + ms, 0);
      this.delta(sum(this.inLap) - sum(leader.sectors));
    }
    this.all("tower").forEach((each) => this.tower(each));
  }

  delta(ms) {
    this.all("delta").forEach((each) => {
      each.textContent = ms === null ? "" : signed(ms);
      each.classList.toggle("ahead", ms !== null && ms < 0);
      each.classList.toggle("behind", ms !== null && ms >= 0);
      if (ms !== null) each.title = (ms < 0 ? this.words.ahead : this.words.behind).replace("%s", signed(ms));
    });
  }

  // --- the leader's run, which was shown ---------------------------------------------------------------------------
  async fetchGhost() {
    const { leader } = this.told;
    const wanted = leader ? `${leader.slot}:${leader.whole ? "" : leader.lap}` : "";
    const { show } = this.root;
    if (this.fetching || wanted === this.has || !this.root.querySelector("[data-viewer]")) return;
    if (!leader) { show.accompany(null); this.has = wanted; return; }
    this.fetching = true;
    try {
      if (this.has !== undefined) await new Promise((done) => setTimeout(done, Math.random() * GHOST_MS));
      const query = new URLSearchParams({ slot: leader.slot, ...(leader.whole ? {} : { lap: leader.lap }) });
      const answer = await fetch(`${this.root.dataset.ghostOf}?${query}`, { signal: AbortSignal.timeout(15000) });
      if (!answer.ok) throw new Error(String(answer.status));
      show.accompany(new Ghost({ ...await answer.json(), laps: [], name: leader.racer }, { ghost: true }), leader.whole);
      this.has = wanted;
    } catch { setTimeout(() => this.fetchGhost(), 5000 + 5000 * Math.random()); } finally { this.fetching = false; }
    if (this.told.leader && this.has === wanted) this.fetchGhost(); // another one may lead by now
  }
}

document.querySelectorAll("[data-show]").forEach((root) => { root.screen = new Screen(root); });
