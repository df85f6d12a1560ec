// The page on which a visitor drives: a car with the simulator's response, in the viewer, against any ghost.
import { DrivenCar } from "./car.js";
import { Controls } from "./driving-controls.js";
import { DrivingReferee, Road } from "./driving-referee.js";
import { createFlatMap } from "./flat-map.js";
import { Ghost } from "./live-replay.js";
import { fetchDocument, NOSE_M, Run } from "./store.js";
import { clock, offerFullScreen } from "./stage.js";
import { hasWebGL } from "./webgl.js";

const STEP_MS = 1000 / 15;
const MOST_MS = 120; // of a frame: a page that was away does not drive on
const NAMES = ["t", "x", "y", "yaw", "v", "steer", "lap", "status", "progress", "on_track"];
const CAMERAS = ["chase", "onboard", "top", "trackside"];

const isTouched = () => matchMedia("(pointer: coarse)").matches;

// The visitor's car as a run that grows while it drives.
class LiveRun extends Run {
  constructor(name, look) {
    super({ columns: Object.fromEntries(NAMES.map((column) => [column, []])), laps: [], name, look });
    this.duration = Infinity;
  }

  add({ t, pose, v, steer, lap, status, progress }) {
    const { x, y, yaw } = pose, degrees = (yaw * 180) / Math.PI;
    const row = [t, x + NOSE_M * Math.cos(yaw), y + NOSE_M * Math.sin(yaw), degrees, v, steer, lap, status, progress, true];
    NAMES.forEach((name, n) => this.columns[name].push(row[n]));
  }

  clear() { for (const name of NAMES) this.columns[name].length = 0; this.index = 0; }
}

export class Drive {
  constructor(root, setup, scene) {
    Object.assign(this, { root, setup, scene, words: setup.words, now: 0, running: false });
    this.part = (name) => root.querySelector(`[data-${name}]`);
    this.referee = new DrivingReferee(new Road(scene), setup.physics, setup.penalty_ms);
    this.car = new DrivenCar(setup.physics, this.referee.start);
    this.controls = new Controls(root, setup.physics);
    this.me = new LiveRun(setup.words.you, setup.look);
    this.replay = { scene, runs: [this.me], boxes: [], bots: [], duration: Infinity };
    this.restart();
    this.map = createFlatMap(this.part("map"), this.replay);
    this.views = [this.map];
    this.part("again").addEventListener("click", () => { this.restart(); this.draw(); });
    this.part("ghost").addEventListener("change", () => this.race());
    this.fillScreen = offerFullScreen(root, this.part("full"));
    this.part("camera").addEventListener("change", ({ target }) => { this.view?.setCamera(target.value); this.draw(); });
    this.part("tilt").addEventListener("click", async ({ currentTarget }) => {
      const wasUsed = this.controls.tilt !== null, isUsed = await this.controls.useTilt();
      currentTarget.setAttribute("aria-pressed", String(isUsed));
      if (!wasUsed && !isUsed) this.note(this.words.no_tilt);
    });
    this.part("tilt").hidden = !("DeviceOrientationEvent" in window && isTouched());
    // a choice by pointer gives the keys back to the car; by keys they stay with the list
    for (const select of [this.part("ghost"), this.part("camera")]) {
      let byPointer = false;
      select.addEventListener("pointerdown", () => { byPointer = true; });
      select.addEventListener("keydown", () => { byPointer = false; });
      select.addEventListener("change", () => { if (byPointer) this.part("stage").focus({ preventScroll: true }); });
    }
    window.addEventListener("keydown", (event) => this.press(event));
    this.resized = new ResizeObserver(() => { for (const view of this.views) view.resize(); this.draw(); });
    this.resized.observe(this.part("stage"));
    this.frame = (moment) => this.tick(moment);
    requestAnimationFrame(this.frame);
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input, textarea")) return;
    const select = this.part("camera");
    if (event.key === "r" || event.key === "R") { this.restart(); this.draw(); }
    if (event.key === "f" || event.key === "F") this.fillScreen();
    if ((event.key === "c" || event.key === "C") && this.view) {
      select.value = CAMERAS[(CAMERAS.indexOf(select.value) + 1) % CAMERAS.length];
      this.view.setCamera(select.value);
    }
  }

  async mount() {
    if (!hasWebGL()) return;
    const { createScene } = await import("./scene.js");
    this.part("scene").hidden = false;
    this.part("stage").classList.add("in-3d");
    const leave = () => { this.views = [this.map]; this.part("scene").hidden = true; this.part("stage").classList.remove("in-3d"); this.view = null; };
    this.view = createScene(this.part("scene"), this.replay, { onLost: leave });
    this.views = [this.view, this.map];
    this.part("cameras").hidden = false;
    this.draw();
  }

  note(text) {
    this.part("note").textContent = text;
    this.part("note").hidden = !text;
  }

  // To the start of lap 1; the clock begins with the first command.
  restart() {
    Object.assign(this, { now: 0, running: false });
    this.referee.begin();
    this.controls.reset();
    this.car.place(this.referee.start);
    this.referee.put(this.car);
    this.me.clear();
    this.record([{ ...this.pose, v: 0 }], 0, "prepare");
    if (this.ghost) this.ghost.from = 0;
    this.note(isTouched() ? this.words.ready_touch : this.words.ready);
  }

  get pose() { return { x: this.car.x, y: this.car.y, yaw: this.car.yaw }; }

  record(poses, steer, status) {
    const { referee } = this, begin = referee.ms;
    poses.forEach((pose, k) => this.me.add({
      t: begin + (poses.length > 1 ? ((k + 1) / poses.length) * STEP_MS : 0), pose, v: pose.v, steer, lap: referee.lap, status, progress: referee.progress,
    }));
  }

  // One control step.
  step() {
    const { referee, car } = this;
    if (referee.pause > 0) {
      this.record([0, 0, 0, 0].map(() => ({ ...this.pose, v: 0 })), 0, "pause");
      referee.wait();
      if (referee.pause === 0) this.note("");
      return;
    }
    const [steering, speed] = this.command;
    this.record(car.step(steering, speed), steering, "in_progress");
    const found = referee.judge(car);
    if (!found) return;
    if (found.back) car.place(found.back);
    if (found.kind === "off_track") {
      this.controls.reset();
      this.controls.touched = true;
      this.note(this.words.off_track);
    } else {
      if (this.ghost) this.ghost.from = referee.lapStartMs;
      this.note(`${this.words.lap} ${referee.lap - 1} · ${clock(referee.lastMs)}`);
      clearTimeout(this.noted);
      this.noted = setTimeout(() => this.note(""), 4000);
    }
  }

  tick(moment) {
    if (!this.root.isConnected) { this.dispose(); return; }
    const passed = Math.min(MOST_MS, moment - (this.before ?? moment));
    this.before = moment;
    this.command = this.controls.read(passed / 1000);
    if (!this.running && this.controls.touched) { this.running = true; this.note(""); }
    if (this.running) {
      this.now += passed;
      while (this.referee.ms < this.now) this.step();
    }
    if (this.running || this.asked) this.draw();
    requestAnimationFrame(this.frame);
  }

  draw() {
    for (const view of this.views ?? []) view.draw(this.replay, this.now);
    const { referee, ghost } = this, text = (name, value) => { const part = this.part(name); if (part.textContent !== value) part.textContent = value; };
    text("time", clock(Math.max(0, this.now - referee.lapStartMs)));
    text("lap", String(referee.lap));
    text("last", referee.lastMs === null ? "–" : clock(referee.lastMs));
    text("best", referee.bestMs === null ? "–" : clock(referee.bestMs));
    text("speed", Math.max(0, this.car.speed * Number(referee.pause === 0 && this.running)).toFixed(1));
    const theirs = ghost && this.running ? ghost.timeAt(referee.progress) : null;
    const gap = theirs === null ? null : (referee.lapMs - theirs) / 1000;
    text("gap", gap === null ? "" : `${gap < 0 ? "−" : "+"}${Math.abs(gap).toFixed(2)}`);
    this.part("gap").classList.toggle("ahead", gap !== null && gap < 0);
  }

  // Against the ghost that is chosen.
  async race() {
    const { value, selectedOptions: [option] } = this.part("ghost");
    this.ghost = null;
    if (value) {
      try {
        this.ghost = new Ghost(await fetchDocument(value), { lap: Number(option.dataset.lap), ghost: true });
      } catch { this.note(this.words.failed); }
    }
    this.replay.runs = this.ghost ? [this.me, this.ghost] : [this.me];
    this.replay.line = this.ghost;
    this.map.dispose();
    this.map = createFlatMap(this.part("map"), this.replay);
    this.views = this.view ? [this.view, this.map] : [this.map];
    this.restart();
    this.draw();
  }

  dispose() {
    this.resized.disconnect();
    this.controls.stop.abort();
    for (const view of this.views) view.dispose();
  }
}

async function start(root) {
  const setup = JSON.parse(root.dataset.drive);
  root.querySelector("[data-scripted]").hidden = false;
  try {
    const drive = (root.drive = new Drive(root, setup, await fetchDocument(setup.scene)));
    await drive.race();
    await drive.mount().catch(() => {});
    root.dataset.ready = "";
  } catch (error) {
    const note = root.querySelector("[data-note]");
    [note.textContent, note.hidden] = [setup.words.failed, false];
    throw error;
  }
}

document.querySelectorAll("[data-drive]").forEach(start);
