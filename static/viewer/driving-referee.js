// Judges a car that a visitor drives, as the simulator's referee does: laps over the line, off track with all four
// wheels, back to the nearer lane's middle and a wait. Boxes and other cars are not there.
import { NOSE_M } from "./store.js";

const WINDOW_M = 2; // of the next projection, along the centre line
const STRIDE_M = 0.6; // the most that is credited in a step
const STEP_MS = 1000 / 15;

export class Road {
  constructor({ centre, inner, outer, direction, closed, start, finish }) {
    Object.assign(this, { centre, closed });
    [this.left, this.right] = direction === "ccw" ? [inner, outer] : [outer, inner];
    this.outlines = closed ? [inner, outer] : [[...outer, ...[...inner].reverse()]];
    this.count = closed ? centre.length : centre.length - 1;
    this.metres = [0];
    for (let i = 0; i < this.count; i += 1) this.metres.push(this.metres[i] + Math.hypot(...this.lead(i)));
    this.whole = this.metres[this.count];
    this.from = closed ? 0 : this.project(start.x, start.y).metres;
    this.length = closed ? this.whole : this.project(finish.x, finish.y).metres - this.from;
  }

  lead(i) {
    const [a, b] = [this.centre[i], this.centre[(i + 1) % this.centre.length]];
    return [b[0] - a[0], b[1] - a[1]];
  }

  // The nearest place of the centre line, within a window of a segment if one is named: metres from the start of the
  // rows, metres to the left, the segment, the share of it.
  project(x, y, near = null) {
    let best = null;
    for (let i = 0; i < this.count; i += 1) {
      if (near !== null) {
        const away = Math.abs(this.metres[i] - this.metres[near]);
        if (Math.min(away, this.closed ? this.whole - away : away) > WINDOW_M) continue;
      }
      const [dx, dy] = this.lead(i), [px, py] = [x - this.centre[i][0], y - this.centre[i][1]], long = Math.hypot(dx, dy) || 1e-9;
      const share = Math.max(0, Math.min(1, (px * dx + py * dy) / (long * long))), side = (dx * py - dy * px) / long;
      const away = Math.hypot(px - share * dx, py - share * dy);
      if (!best || away < best.away) best = { metres: this.metres[i] + share * long, offset: Math.sign(side) * away, away, index: i, share };
    }
    return best;
  }

  // Metres from the centre line to both borders.
  halves({ index, share }) {
    const after = (index + 1) % this.centre.length;
    return [this.left, this.right].map((line) => {
      const wide = (i) => Math.hypot(line[i][0] - this.centre[i][0], line[i][1] - this.centre[i][1]);
      return wide(index) + share * (wide(after) - wide(index));
    });
  }

  // The pose `offset` metres to the left of the centre line.
  pose(metres, offset) {
    const d = this.closed ? ((metres % this.whole) + this.whole) % this.whole : Math.max(0, Math.min(this.whole, metres));
    let i = 0;
    while (i < this.count - 1 && this.metres[i + 1] <= d) i += 1;
    const [dx, dy] = this.lead(i), long = Math.hypot(dx, dy) || 1e-9, share = (d - this.metres[i]) / long;
    const [x, y] = [this.centre[i][0] + share * dx, this.centre[i][1] + share * dy];
    return { x: x - (dy / long) * offset, y: y + (dx / long) * offset, yaw: Math.atan2(dy, dx), index: i, share };
  }

  contains(x, y) {
    let inside = false;
    for (const line of this.outlines) {
      for (let i = 0, j = line.length - 1; i < line.length; j = i, i += 1) {
        const [[ax, ay], [bx, by]] = [line[i], line[j]];
        if ((ay > y) !== (by > y) && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
      }
    }
    return inside;
  }
}

export class DrivingReferee {
  constructor(road, physics, penaltyMs) {
    Object.assign(this, { road, physics, penaltySteps: Math.max(1, Math.ceil((penaltyMs * 15) / 1000 - 1e-9)) });
    // a nose so far beyond the border has all wheels off this part of the road: the rear ones are the farthest from it
    this.reach = Math.hypot(NOSE_M - physics.rear_axle_x, physics.half_track);
    this.begin();
  }

  begin() {
    Object.assign(this, { steps: 0, lap: 1, lapStartMs: 0, lapFrom: 0, metres: 0, pause: 0, offTracks: 0, lastMs: null, bestMs: null, place: null });
  }

  get start() { return this.road.pose(this.road.from, 0); }

  get ms() { return this.steps * STEP_MS; }

  get lapMs() { return this.ms - this.lapStartMs; }

  // Percent of the lap.
  get progress() { return Math.max(0, Math.min(100, (100 * (this.metres - this.lapFrom)) / this.road.length)); }

  nose({ x, y, yaw }) { return [x + NOSE_M * Math.cos(yaw), y + NOSE_M * Math.sin(yaw)]; }

  // The car was put at a pose.
  put(pose) {
    this.place = this.road.project(...this.nose(pose), this.place?.index ?? null);
    if (this.steps === 0) this.metres = this.place.metres - this.road.from;
  }

  // One control step to a pose. Returns what happened: null, "lap", or "off_track" with the pose to go back to.
  judge(pose) {
    const { road } = this, before = this.metres, from = this.place;
    this.steps += 1;
    const place = road.project(...this.nose(pose), from.index);
    let gained = place.metres - from.metres;
    if (road.closed) gained = ((((gained + road.whole / 2) % road.whole) + road.whole) % road.whole) - road.whole / 2;
    if (Math.abs(gained) <= STRIDE_M) { this.metres += gained; this.place = place; }
    if (this.metres >= this.lapFrom + road.length) {
      const share = gained > 0 ? (this.lapFrom + road.length - before) / gained : 1;
      const at = Math.round((this.steps - 1 + Math.min(1, Math.max(0, share))) * STEP_MS);
      this.lastMs = at - this.lapStartMs;
      this.bestMs = Math.min(this.lastMs, this.bestMs ?? Infinity);
      this.lapStartMs = at;
      this.lapFrom += road.length;
      this.lap += 1;
      this.offTracks = 0;
      return { kind: "lap", back: road.closed ? null : this.toStart() };
    }
    const [left, right] = road.halves(place), elsewhere = place.offset > left + this.reach || place.offset < -right - this.reach;
    if (!elsewhere && this.wheels(pose).some(([x, y]) => road.contains(x, y))) return null;
    this.offTracks += 1;
    this.pause = this.penaltySteps;
    return { kind: "off_track", back: this.putBack(before, from) };
  }

  // A control step of a penalty.
  wait() {
    this.steps += 1;
    this.pause -= 1;
  }

  wheels({ x, y, yaw }) {
    const { front_axle_x: front, rear_axle_x: rear, half_track: side } = this.physics, [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    return [front, rear].flatMap((axle) => [side, -side].map((w) => [x + axle * c - w * s, y + axle * s + w * c]));
  }

  // The middle of the lane nearer to where it came from, and never beyond the line.
  putBack(metres, from) {
    const { road } = this, at = Math.min(metres, this.lapFrom + road.length - NOSE_M - 0.01) + road.from;
    const [left, right] = road.halves(road.pose(at, 0)), pose = road.pose(at, from.offset >= 0 ? left / 2 : -right / 2);
    this.place = { ...road.project(...this.nose(pose), pose.index) };
    this.metres = at - road.from + NOSE_M;
    return pose;
  }

  toStart() {
    const pose = this.start;
    this.place = this.road.project(...this.nose(pose), pose.index);
    this.metres = this.lapFrom + this.place.metres - this.road.from;
    return pose;
  }
}
