// The cars of a replay over time, from the run documents (races/replays/document.py). Metres and degrees of the world:
// x right, y up, yaw anticlockwise. A car's x and y are its nose, as in the trace: NOSE_M before its middle. Bots and
// boxes have their middles.

export const JUMP_M = 0.6; // a reset moves a car at once: nothing to glide over
export const NOSE_M = 0.14;
export const PARTS = 20; // of a lap, for its differences
const DIFFERENCE_MS = 50; // gained or lost within a part
const LOOK_MS = 100; // between two looks for overtakes
const CLOSE = 0.1; // percent of a lap: side by side

// The shorter turn from one heading to another, in degrees.
export const turn = (from, to) => ((((to - from + 180) % 360) + 360) % 360) - 180;

// The last index with values[index] <= value, at least 0; looked for from `from` on, which is near in a replay.
export function lastAt(values, value, from = 0) {
  let low = values[from] <= value ? from : 0;
  if (values[low + 1] > value || low + 1 >= values.length) return low;
  if (values[low + 2] > value) return low + 1;
  let high = values.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle; else high = middle;
  }
  return low;
}

// Where columns are at `share` between steps i and next.
export function between({ x, y, yaw }, i, next, share) {
  if (next === i || Math.hypot(x[next] - x[i], y[next] - y[i]) > JUMP_M) return { x: x[i], y: y[i], yaw: yaw[i] };
  return { x: x[i] + share * (x[next] - x[i]), y: y[i] + share * (y[next] - y[i]), yaw: yaw[i] + share * turn(yaw[i], yaw[next]) };
}

// The middle of a car whose nose is at a pose.
export function middle({ x, y, yaw }) {
  const angle = (yaw * Math.PI) / 180;
  return { x: x - NOSE_M * Math.cos(angle), y: y - NOSE_M * Math.sin(angle), yaw };
}

// One car. Its clock begins with lap `lap` of the run, or with the run for 0; that of a rival with its leader's: `with`.
export class Run {
  constructor({ columns, laps, name, look, events = [], number = 0, run = "", href = "" }, { lap = 0, ghost = false, with: leader } = {}) {
    Object.assign(this, { columns, laps, name, look, number, run, href, lap, ghost, index: 0, events: events.filter(({ car }) => car === number) });
    const { t } = columns;
    const last = t.length ? t[t.length - 1] : 0;
    const chosen = laps.find((each) => each.number === lap);
    const isWhole = chosen?.complete ?? (laps.length > 0 && laps.every((each) => each.complete));
    this.start = leader ? leader.start : chosen?.start_ms ?? 0;
    this.end = chosen ? chosen.start_ms + chosen.time_ms : last;
    if (!isWhole) this.end = Math.min(this.end, last);
    if (leader?.lap) this.end = Math.min(last, leader.end);
    this.duration = Math.max(0, this.end - this.start);
    this.complete = isWhole && !leader?.lap;
    this.measure(leader?.lap || chosen?.number || 1, chosen?.number ?? 0);
  }

  // How far it is at which time of its clock, in percent of a lap since the start of lap `first`; a place that it passes
  // twice counts once. `only`: that lap alone.
  measure(first, only) {
    const { t, lap, progress } = this.columns;
    const begin = t.length ? lastAt(t, this.start) : 0;
    [this.reachedMs, this.reached] = [[0], [only || !t.length ? 0 : (lap[begin] - first) * 100 + progress[begin]]];
    for (let i = begin; i < t.length && t[i] <= this.end; i += 1) {
      if (t[i] > this.start && !(only && lap[i] !== only)) this.reach(t[i], (lap[i] - first) * 100 + progress[i]);
    }
    if (this.complete) this.reach(this.end, only ? 100 : 100 * this.laps.length);
  }

  reach(t, far) {
    if (far <= this.reached[this.reached.length - 1]) return;
    this.reachedMs.push(t - this.start);
    this.reached.push(far);
  }

  // The state at a time of its clock, interpolated between two steps.
  at(ms) {
    const { t, v, steer, lap, status, progress, on_track: onTrack = [] } = this.columns;
    const moment = Math.min(Math.max(ms, 0), this.duration) + this.start;
    const i = this.index = lastAt(t, moment, this.index);
    const next = Math.min(i + 1, t.length - 1);
    const share = next === i ? 0 : Math.max(0, (moment - t[i]) / (t[next] - t[i]));
    return {
      i, ...between(this.columns, i, next, share), v: v[i], steer: steer[i], lap: this.lapAt(moment)?.number ?? lap[i], status: status[i],
      progress: progress[i], onTrack: onTrack[i], done: !this.grows && ms > this.duration, standing: status[i] === "pause",
    };
  }

  // How far it has come by a time of its clock.
  farAt(ms) {
    const i = lastAt(this.reachedMs, ms);
    if (i + 1 >= this.reached.length) return this.reached[i];
    const share = (Math.max(ms, 0) - this.reachedMs[i]) / (this.reachedMs[i + 1] - this.reachedMs[i]);
    return this.reached[i] + share * (this.reached[i + 1] - this.reached[i]);
  }

  // When it was so far first; null if it never was.
  timeAt(far) {
    const i = lastAt(this.reached, far);
    if (this.reached[i] >= far) return this.reachedMs[i];
    if (i + 1 >= this.reached.length) return null;
    const share = (far - this.reached[i]) / (this.reached[i + 1] - this.reached[i]);
    return this.reachedMs[i] + share * (this.reachedMs[i + 1] - this.reachedMs[i]);
  }

  // The lap that is driven at a moment of the run: it begins at the line, between two steps.
  lapAt(moment) {
    if (this.lap) return this.laps.find((each) => each.number === this.lap);
    return this.laps.findLast((each) => each.start_ms <= moment);
  }

  // The time within the lap that is driven then.
  inLap(ms) {
    const now = Math.min(Math.max(ms, 0), this.duration) + this.start;
    return Math.max(0, now - (this.lapAt(now)?.start_ms ?? 0));
  }
}

// All cars of a page: `runs[0]` is the one whose page it is, its rivals follow, then the ghosts of other runs.
// `entries`: {document, lap, name, look} each.
export class Replay {
  constructor(scene, entries) {
    const first = entries[0]?.document ?? {};
    this.scene = scene;
    this.runs = entries.flatMap(({ document, lap = 0, name, look }, at) => {
      const own = { ...document, ...(name && { name }), ...(look && { look: { ...document.look, ...look } }) };
      const cars = [new Run(own, { lap, ghost: at > 0 })];
      if (at === 0) for (const rival of document.rivals) cars.push(new Run(rival, { with: cars[0] }));
      return cars;
    }).filter((run) => run.columns.t.length > 1);
    this.boxes = first.boxes ?? [];
    // A bot has a place for each step of the first car.
    this.bots = (first.bots ?? []).map((columns) => this.bot(columns));
    this.duration = Math.max(0, ...this.runs.map((run) => run.duration));
  }

  bot(columns) {
    return {
      columns,
      at: (ms) => {
        const car = this.runs[0];
        const { t } = car.columns;
        const moment = Math.min(Math.max(ms, 0) + car.start, t[t.length - 1]);
        const i = Math.min(lastAt(t, moment, car.index), columns.x.length - 1);
        const next = Math.min(i + 1, columns.x.length - 1);
        return between(columns, i, next, next === i ? 0 : Math.max(0, (moment - t[i]) / (t[next] - t[i])));
      },
    };
  }

  // The runs that are compared: the rows of the tower.
  get ranked() { return this.runs; }

  // {ms, kind, run}: off_track, crash, reset and lap of each car, overtakes, and where the first car differs.
  get events() {
    this.found ??= [...this.incidents(), ...this.overtakes(), ...this.differences()].sort((a, b) => a.ms - b.ms);
    return this.found;
  }

  incidents() {
    return this.ranked.flatMap((run) => run.events
      .filter(({ t }) => t >= run.start && t <= run.start + run.duration)
      .map(({ t, kind }) => ({ ms: t - run.start, kind, run })));
  }

  overtakes() {
    const found = [];
    const ahead = new Map();
    if (this.ranked.length < 2) return found;
    for (let ms = LOOK_MS; ms <= this.duration; ms += LOOK_MS) {
      const far = this.ranked.map((run) => run.farAt(ms));
      for (let a = 0; a < far.length; a += 1) {
        for (let b = a + 1; b < far.length; b += 1) {
          if (Math.abs(far[a] - far[b]) < CLOSE) continue;
          const leads = far[a] > far[b] ? a : b;
          const pair = a * far.length + b;
          const over = ms > this.ranked[a].duration || ms > this.ranked[b].duration;
          if (ahead.has(pair) && ahead.get(pair) !== leads && !over) {
            found.push({ ms, kind: "overtake", run: this.ranked[leads], of: this.ranked[leads === a ? b : a] });
          }
          ahead.set(pair, leads);
        }
      }
    }
    return found;
  }

  differences() {
    const [one, ...others] = this.ranked;
    const found = new Map();
    const step = 100 / PARTS;
    for (const other of others) {
      let gap = 0;
      for (let far = step; ; far += step) {
        const [mine, theirs] = [one.timeAt(far), other.timeAt(far)];
        if (mine === null || theirs === null) break;
        const change = theirs - mine - gap;
        gap = theirs - mine;
        const ms = one.timeAt(far - step);
        if (Math.abs(change) >= DIFFERENCE_MS && !found.has(ms)) found.set(ms, { ms, kind: "difference", run: one, of: other, change });
      }
    }
    return [...found.values()];
  }

  // The order at a time: the car that is farthest first. `gap`: ms behind the leader, `interval`: behind the car before;
  // null where it is not known.
  order(ms) {
    const rows = this.ranked.map((run, number) => {
      const far = run.farAt(ms);
      return { run, number, far, ms: !run.grows && ms >= run.duration ? (run.timeAt(far) ?? run.duration) : ms, done: !run.grows && ms >= run.duration };
    });
    rows.sort((a, b) => b.far - a.far || a.ms - b.ms || a.number - b.number);
    rows.forEach((row, at) => {
      const behind = (other) => {
        const passed = other.run.timeAt(row.far);
        return row.done && !row.run.complete || passed === null ? null : Math.max(0, Math.round(row.ms - passed));
      };
      row.gap = at ? behind(rows[0]) : 0;
      row.interval = at ? behind(rows[at - 1]) : 0;
    });
    return rows;
  }
}

// A document; asked for twice if the server or the line fails.
export async function fetchDocument(url, tries = 2) {
  const answer = await fetch(url, { headers: { Accept: "application/json" } }).catch((error) => error);
  if (answer.ok) return answer.json();
  if (tries > 1 && !(answer.status < 500)) {
    await new Promise((done) => setTimeout(done, 500));
    return fetchDocument(url, tries - 1);
  }
  throw Object.assign(new Error(String(answer.status ?? answer.message)), { status: answer.status ?? 0 });
}

// The replay of {scene, runs: [{url, lap, name, look}], together}, a run with its `document` instead of its address perhaps;
// `together`: the address of one answer with documents by their addresses. `lost`: the runs whose document could not be loaded, with their error; throws if the first or the
// scene is lost.
export async function loadReplay({ scene, runs, together }) {
  const known = together ? await fetchDocument(together).catch(() => ({})) : {};
  const read = (url) => known[url] ?? fetchDocument(url);
  const [road, ...found] = await Promise.allSettled([read(scene), ...runs.map(({ url, document: given }) => given ?? read(url))]);
  for (const needed of [road, found[0]]) if (needed.status === "rejected") throw needed.reason;
  const entries = runs.map((run, at) => ({ ...run, document: found[at].value, error: found[at].reason }));
  const replay = new Replay(road.value, entries.filter((entry) => entry.document));
  return { replay, lost: entries.filter((entry) => entry.error) };
}
