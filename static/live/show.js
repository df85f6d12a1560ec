// Plays the run on track at the same instant for everybody, from half-second chunks of poses (live/live-feed.js), in the
// viewer (viewer/stage.js) where the page has one, and dispatches "show:state", "show:reactions", "show:frame",
// "show:event" and "show:again" (events are replayed) on [data-show].
import { clock, isStill, Stage } from "../viewer/stage.js";
import { LiveReplay } from "../viewer/live-replay.js";
import { fetchDocument } from "../viewer/store.js";

const STILL_MS = 1000;
const FIGURES_MS = 100; // nobody reads faster
const LEFT_MS = 500; // so long a car stands where its run ended
const LOST_MS = 30000; // and so long one of whose run nothing more came
const BACK_MS = 250; // a clock that is set right goes back by less
const AGAIN_MS = 5000; // until a missing scene is requested again
const NONE = document.createElement("i"); // what a screen does not show

class Show {
  constructor(root) {
    this.root = root;
    this.parts = new Map();
    const { follow: topic, show: state, poses } = root.dataset;
    const hear = {
      state: (told) => { this.state = told; this.take(told.current); this.tellState(); },
      reactions: (counts) => this.tell("reactions", counts),
      poses: (told) => this.add(told),
    };
    this.feed = new window.paddockFeed.Feed({ topic, state, poses }, hear);
    this.clock = this.feed.clock;
    this.forget();
    const viewer = root.querySelector("[data-viewer]");
    if (viewer) this.mount(viewer, JSON.parse(viewer.dataset.viewer));
  }

  async mount(root, setup) {
    try {
      this.scene = { ...await fetchDocument(setup.scene), begins: setup.begins };
    } catch { setTimeout(() => this.mount(root, setup), AGAIN_MS); return; }
    this.boxes = setup.boxes;
    Object.assign(this.replay, { scene: this.scene, boxes: this.boxes });
    this.stage = root.viewer = new (window.paddockFeed.Stage ?? Stage)(root, setup, this.replay, []);
    if (this.feed.mount) { this.feed.mount(this.stage); return; }
    this.stage.offerCameras(new URLSearchParams(location.search).get("camera") ?? "");
    root.addEventListener("keydown", ({ key, target }) => {
      if (target.closest("select")) return;
      if (key === "c") this.stage.nextCamera();
      if (key === "f") this.stage.fillScreen();
    });
  }

  // An element of the page; a screen shows some of them.
  part(name) {
    const known = this.parts.get(name);
    if (known && (known.isConnected || known === NONE)) return known;
    const found = this.root.querySelector(`[data-${name}]`) || NONE;
    this.parts.set(name, found);
    return found;
  }

  // The car whose run it is.
  get car() { return this.replay.cars[0]; }

  forget() {
    this.slot = null;
    this.feed.play(null);
    this.over = false;
    this.begins([]);
  }

  // Another run: its cars are given by the steps that come.
  begins(cars) {
    const shown = cars.map(({ number, racer, look }) => ({ number, name: racer, look: look ?? { shell: "paddock", colour: "#888888", above: "" } }));
    this.replay = new LiveReplay(this.scene, shown, { boxes: this.boxes, lead: this.feed.lead, tail: this.feed.tail });
    this.replay.ghost = cars.length === 1 ? this.ghost : null;
    this.happened = [];
    this.step = null;
    this.rewind();
  }

  // What happened is still to come.
  rewind() {
    Object.assign(this, { told: 0, lapFrom: 0, best: null, drawnAt: -Infinity });
    this.placeGhost();
    for (const name of ["last-lap", "best-lap"]) this.write(name, "–");
  }

  tell(name, detail) { this.root.dispatchEvent(new CustomEvent(`show:${name}`, { detail, bubbles: true })); }

  tellState() { this.tell("state", structuredClone(this.state)); } // screens write best sectors into theirs

  write(name, text) {
    const part = this.part(name);
    if (part === NONE || part.textContent === text) return;
    const node = part.firstChild;
    if (node && node === part.lastChild && node.nodeType === Node.TEXT_NODE) node.data = text;
    else part.textContent = text;
  }

  take(current) {
    const id = current && current.slot;
    if (id && this.slot && id === this.slot.slot && current.starts_at === this.slot.starts_at) { this.slot = current; return; }
    if (!id) {
      // what is left of a run that is over is played to its end; a launch that was undone is gone at once
      if (this.slot && (this.clock.now() < this.slot.starts_at || this.isPlayed())) this.leave();
      return;
    }
    this.forget();
    this.slot = current;
    this.begins(current.cars);
    this.stage?.show(this.replay);
    this.feed.play(current);
    this.part("stage-card").hidden = !this.state || !["running", "paused"].includes(this.state.phase);
    this.blank();
    this.part("who").replaceChildren(...this.names(current));
    this.begin();
  }

  // Who drives; in a duel each in the colour of their car.
  names(current) {
    if (current.cars.length < 2) return [current.racer];
    return current.cars.flatMap(({ number, racer, look }) => {
      const name = document.createElement("span");
      name.className = "show-name";
      name.style.setProperty("--dot", look?.colour ?? "");
      name.textContent = racer;
      if (!number) return [name];
      const between = document.createElement("span"); // where there is room they stand below each other
      between.className = "show-between";
      between.textContent = " – ";
      return [between, name];
    });
  }

  // Nothing of the run before is left.
  blank() { for (const name of ["clock", "lap-number", "speed", "steer", "last-lap", "best-lap"]) this.write(name, name === "clock" ? "" : "–"); }

  // Nobody is on track.
  leave() {
    this.forget();
    if (!this.stage?.player) this.stage?.show(this.replay);
    this.blank();
    const [next] = (this.state && this.state.next) || [];
    this.write("who", next ? this.root.dataset.upNext.replace("%s", () => next.racer) : this.root.dataset.nobody);
    this.tellState();
  }

  // Poses have come. before: what happened in the part of the run that this page never saw.
  add({ chunks, over, before }) {
    if (before) { this.begins(this.slot.cars); this.tell("again"); this.tellState(); }
    for (const chunk of [...(before ? [before] : []), ...chunks]) {
      this.replay.add(chunk, (chunk.n + 1) * this.state.chunk_ms);
      this.happened.push(...chunk.events);
    }
    if (over) this.replay.finish();
    if (before || over) this.stage?.show(this.replay);
    this.over = over;
    this.begin();
  }

  // --- drawing: while somebody is on track, a frame moves cars, and nothing else ---------------------------------------
  begin() {
    if (this.drawing || !this.slot) return;
    this.drawing = true;
    requestAnimationFrame(() => this.draw());
  }

  moment() {
    const moment = this.clock.now() - this.slot.starts_at - this.state.behind_ms;
    return isStill() ? Math.floor(moment / STILL_MS) * STILL_MS : moment; // from place to place, without gliding
  }

  // Whether there is nothing left to play: it was, or nothing came for long.
  isPlayed() { return this.moment() > Math.max(...this.replay.cars.map(({ end }) => end)) + (this.over ? LEFT_MS : LOST_MS); }

  draw() {
    this.drawing = Boolean(this.slot);
    if (!this.slot) return;
    requestAnimationFrame(() => this.draw());
    if (!this.state || !this.clock.known) return;
    if (this.told && this.happened[this.told - 1].t > this.moment() + BACK_MS) { this.rewind(); this.tell("again"); this.tellState(); }
    const soon = this.slot.starts_at - this.clock.now();
    if (soon > 0) {
      this.write("clock", this.root.dataset.soon.replace("%s", String(Math.ceil(soon / 1000))));
      return;
    }
    if (!this.state.current && this.isPlayed()) { this.leave(); return; }
    if (this.replay.runs.length) this.frame(this.moment());
  }

  frame(moment) {
    if (!this.stage?.player) this.stage?.draw(Math.max(0, moment)); // a player draws by itself
    while (this.told < this.happened.length && this.happened[this.told].t <= moment) this.happen(this.happened[this.told++]);
    if (!this.car.columns.t.length) return;
    const place = this.car.at(Math.max(0, moment) - this.car.start);
    if (Math.abs(moment - this.drawnAt) >= FIGURES_MS) this.figures(place, moment);
    this.tell("frame", { moment, ...place });
  }

  figures(place, moment) {
    this.drawnAt = moment;
    const at = Math.max(0, Math.min(moment, this.car.end)); // of what the car does: where nothing comes, it stands
    this.write("clock", clock(at - this.lapFrom));
    this.write("lap-number", String(place.lap));
    this.write("speed", `${place.v.toFixed(1)} m/s`);
    this.write("steer", `${place.steer.toFixed(0)}°`.replace("-", "−"));
  }

  // The leader's run beside the one on track; null: none. `whole`: else its clock begins with each lap.
  accompany(ghost, whole) {
    Object.assign(this, { ghost, whole });
    this.placeGhost();
    this.replay.join(this.replay.cars.length === 1 ? ghost : null);
  }

  placeGhost() { if (this.ghost) this.ghost.from = (this.feed.lead ?? 0) + (this.whole ? 0 : this.lapFrom); }

  happen(event) {
    if (event.kind === "lap" && event.car === 0) {
      this.lapFrom = event.t;
      this.placeGhost();
      this.write("last-lap", clock(event.ms));
      this.best = Math.min(this.best ?? event.ms, event.ms);
      this.write("best-lap", clock(this.best));
    }
    this.tell("event", event);
  }
}

document.querySelectorAll("[data-show]").forEach((root) => { root.show = new Show(root); });
