// The clock of a replay. Dispatches "time" whenever the moment changes, "change" when it plays, pauses or changes its
// rate, and "end" when it has played to the end.

export const RATES = [0.1, 0.25, 0.5, 1, 2, 4, 8];

export class Player extends EventTarget {
  constructor(replay) {
    super();
    Object.assign(this, { replay, now: 0, playing: false, loop: false, speed: 1, frame: 0 });
  }

  get rate() { return this.speed; }

  set rate(rate) {
    this.speed = Math.min(Math.max(Number(rate) || 1, RATES[0]), RATES[RATES.length - 1]);
    this.dispatchEvent(new Event("change"));
  }

  play() {
    if (this.playing) return;
    if (this.now >= this.replay.duration) this.seek(0);
    this.playing = true;
    this.dispatchEvent(new Event("change"));
    let before = performance.now();
    const step = (moment) => {
      if (!this.playing) return;
      this.frame = requestAnimationFrame(step);
      const past = Math.max(0, moment - before) * this.speed;
      before = moment;
      if (this.now + past < this.replay.duration) { this.seek(this.now + past); return; }
      this.seek(this.replay.duration);
      if (this.loop) { this.seek(0); return; }
      this.pause();
      this.dispatchEvent(new Event("end"));
    };
    this.frame = requestAnimationFrame(step);
  }

  pause() {
    if (!this.playing) return;
    cancelAnimationFrame(this.frame);
    this.playing = false;
    this.dispatchEvent(new Event("change"));
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  seek(ms) {
    this.now = Math.min(Math.max(Number(ms) || 0, 0), this.replay.duration);
    this.dispatchEvent(new Event("time"));
  }

  // Pauses, and goes `count` steps of the first car's trace on, or back for less than 0.
  step(count) {
    this.pause();
    const run = this.replay.runs[0];
    const { t } = run.columns;
    const here = this.now + run.start;
    let i = run.at(this.now).i;
    if (count < 0 && here > t[i]) i += 1;
    this.seek(t[Math.min(Math.max(i + count, 0), t.length - 1)] - run.start);
  }

  // To the next event of a kind (or the one before for `way` -1); false if there is none.
  jump(kind, way = 1) {
    const events = this.replay.events.filter((event) => event.kind === kind);
    const found = way > 0 ? events.find(({ ms }) => ms > this.now + 1) : events.findLast(({ ms }) => ms < this.now - 1);
    if (!found) return false;
    this.pause();
    this.seek(found.ms);
    return found;
  }
}
