// A replay that grows while its cars drive, and ghosts beside them.
import { Replay, Run } from "./store.js";

const STEP_MS = 70; // at most, between two steps of a trace
const COLUMNS = ["t", "x", "y", "yaw", "v", "steer", "lap", "status", "progress", "on_track"];

// A ghost whose clock begins `from` ms after that of its replay.
export class Ghost extends Run {
  from = 0;

  at(ms) { return super.at(ms - this.from); }
}

// A car whose steps come while it drives; its clock begins `lead` ms before the first.
export class LiveRun extends Run {
  constructor(car, lead = 0) {
    super({ ...car, columns: Object.fromEntries(COLUMNS.map((name) => [name, []])), laps: [{ number: 1, start_ms: 0 }] });
    Object.assign(this, { start: -lead, grows: true });
    this.until(0);
  }

  add(columns) {
    if (this.laterLap) this.laps.push(this.laterLap);
    Object.assign(this, { grows: true, complete: false, laterLap: null });
    const { t, lap, progress } = this.columns;
    const begin = t.length;
    for (const name of COLUMNS) this.columns[name].push(...(columns[name] ?? []));
    if (!begin) {
      [this.reachedMs, this.reached] = [[t[0] - this.start], [(lap[0] - 1) * 100 + progress[0]]];
      this.late = t[0] > 0; // what was before is not known
    }
    for (let i = begin; i < t.length; i += 1) this.reach(t[i], (lap[i] - 1) * 100 + progress[i]);
    this.until(t[t.length - 1]);
  }

  timeAt(far) { return this.late && far < this.reached[0] ? null : super.timeAt(far); }

  until(end) { Object.assign(this, { end, duration: end - this.start }); }

  happen({ t, kind, lap, ms }) {
    this.events.push({ t, kind: kind === "crashed" ? "crash" : kind });
    if (kind !== "lap") return;
    Object.assign(this.laps[this.laps.length - 1], { time_ms: ms, complete: true });
    this.laps.push({ number: lap + 1, start_ms: t });
  }

  // No more steps come. It has driven all of its laps if it stopped where one ended.
  finish() {
    if (!this.grows) return;
    this.grows = false;
    const { number, start_ms: ended } = this.laps[this.laps.length - 1];
    this.complete = number > 1 && ended >= this.end - STEP_MS;
    if (!this.complete) return;
    this.laterLap = this.laps.pop();
    this.until(ended);
    for (; this.reachedMs.at(-1) > this.duration; this.reached.pop()) this.reachedMs.pop();
    this.reach(ended, 100 * this.laps.length);
  }
}

// The run on track of a live event, which grows with each chunk (races/live/streaming/pose_chunks.py). `lead`, `tail`: ms
// that its clock shows before its first and after its last step.
export class LiveReplay extends Replay {
  constructor(scene, cars, { boxes = [], lead = 0, tail = 0 } = {}) {
    super(scene, []);
    Object.assign(this, { boxes, tail, cars: cars.map((car) => new LiveRun(car, lead)), duration: Infinity });
  }

  get ranked() { return this.cars; }

  // A chunk that ends at `until`: a car that has no step at its end drives no more.
  add({ cars = [], bots = [], events }, until = 0) {
    for (const event of events) this.cars[event.car].happen(event);
    for (const columns of cars) {
      const car = this.cars[columns.number];
      if (columns.t.length) car.add(columns);
      if (!columns.t.length || columns.t.at(-1) < until - STEP_MS) car.finish();
    }
    bots.forEach((columns, at) => {
      this.bots[at] ??= this.bot({ x: [], y: [], yaw: [] });
      for (const [name, values] of Object.entries(this.bots[at].columns)) values.push(...columns[name]);
    });
    this.grew();
  }

  finish() {
    for (const car of this.cars) car.finish();
    this.grew();
  }

  grew() {
    this.found = undefined;
    this.duration = this.tail + Math.max(...this.cars.map((car) => (car.grows ? Infinity : car.duration)));
    if (!this.runs.length) this.join(this.ghost);
  }

  // Shows a ghost beside those that drive; null: none.
  join(ghost) {
    this.ghost = ghost;
    if (this.cars.some(({ columns, grows }) => !columns.t.length && grows)) return;
    this.runs = [...this.cars.filter(({ columns }) => columns.t.length), ...(ghost ? [ghost] : [])];
  }
}
