// The stage of a viewer: a replay from above or in three dimensions, its cameras and its timing tower. Whoever has the
// clock calls draw(ms): the player of a replay (viewer.js), or the show of a live event (live/show.js).
import { createFlatMap } from "./flat-map.js";
import { hasWebGL } from "./webgl.js";

const TOWER_MS = 200;
const CAMERAS = ["chase", "onboard", "top", "trackside", "free"];
const MAP = "map";
export const isStill = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

export function clock(ms) {
  const whole = Math.max(0, Math.floor(ms));
  return `${Math.floor(whole / 60000)}:${String(Math.floor(whole / 1000) % 60).padStart(2, "0")}.${String(whole % 1000).padStart(3, "0")}`;
}

// Fills the screen with `root`, or leaves it; `button` is offered where a browser can.
export function offerFullScreen(root, button) {
  if (!button || !document.fullscreenEnabled) return () => {};
  const act = () => (document.fullscreenElement ? document.exitFullscreen() : root.requestFullscreen()).catch(() => {});
  button.hidden = false;
  button.addEventListener("click", act);
  return act;
}

const seconds = (ms) => (ms === null ? "–" : `+${(ms / 1000).toFixed(3)}`);

export class Stage {
  constructor(root, setup, replay) {
    Object.assign(this, { root, setup, words: setup.words, replay, now: 0, camera: MAP });
    this.part = (name) => root.querySelector(`[data-${name}]`);
    this.map = createFlatMap(this.part("map"), replay);
    this.views = [this.map];
    this.fillScreen = offerFullScreen(root, this.part("full"));
    this.tower();
    this.resized = new ResizeObserver(() => { this.views.forEach((view) => view.resize()); this.draw(); });
    this.resized.observe(this.part("stage"));
  }

  note(text) {
    this.part("note").textContent = text;
    this.part("note").hidden = !text;
  }

  draw(now = this.now) {
    this.now = now;
    if (this.rows.length && this.part("tower") && (!this.isPlaying || Math.abs(now - (this.towerAt ?? -Infinity)) >= TOWER_MS)) this.drawTower(now);
    for (const view of this.views) view.draw(this.replay, now);
  }

  // Another replay on the same road.
  show(replay) {
    this.replay = replay;
    this.tower();
    this.draw();
  }

  // --- the timing tower: where several cars drive ------------------------------------------------------------------------
  get isPlaying() { return true; }

  tower() {
    const { ranked } = this.replay;
    this.rows = ranked.length < 2 ? [] : ranked.map((run, number) => {
      const row = document.createElement("tr");
      row.dataset.run = number;
      for (let cell = 0; cell < 6; cell += 1) row.append(document.createElement(cell === 1 ? "th" : "td"));
      row.cells[1].scope = "row";
      // a big screen has no controls
      const [follow, dot] = [this.part("cameras") ? "button" : "span", "span"].map((tag) => document.createElement(tag));
      Object.assign(follow, { type: "button", title: this.words.follow.replace("%s", run.name) });
      dot.className = "dot";
      dot.style.background = run.look.colour;
      follow.append(dot, run.name);
      follow.addEventListener("click", () => { this.chosen = number; this.draw(); });
      row.cells[1].append(follow);
      for (const cell of [0, 2, 3, 4, 5]) row.cells[cell].className = "num";
      return row;
    });
    this.chosen = 0;
    this.part("tower")?.querySelector("tbody").replaceChildren(...this.rows);
    if (this.part("tower")) this.part("tower").hidden = !this.rows.length;
  }

  drawTower(now) {
    this.towerAt = now;
    const body = this.part("tower").querySelector("tbody");
    const order = this.replay.order(now);
    // the car that was chosen; once it has stopped, the first that drives on
    const { number: followed } = [order.find(({ number }) => number === this.chosen), ...order].find(({ done }) => !done) ?? order[0];
    this.rows.forEach((row, number) => { if (row.classList.contains("focus") !== (number === followed)) row.classList.toggle("focus"); });
    this.scene?.setFollow(Math.max(0, this.replay.runs.indexOf(this.replay.ranked[followed])));
    order.forEach(({ run, number, gap, interval, done }, at) => {
      const { cells } = this.rows[number];
      const isOut = done && !run.complete;
      const texts = {
        0: at + 1, 2: run.at(now).lap, 3: clock(run.inLap(now)), 4: at ? isOut ? this.words.out : seconds(gap) : this.words.leads, 5: at ? seconds(interval) : "",
      };
      for (const [cell, text] of Object.entries(texts)) if (cells[cell].textContent !== String(text)) cells[cell].textContent = text;
      if (body.children[at] !== this.rows[number]) body.insertBefore(this.rows[number], body.children[at] ?? null);
    });
  }

  // --- cameras ------------------------------------------------------------------------------------------------------------
  // The names of those that are offered; the map is the last.
  get cameras() { return this.offered ?? []; }

  // Whether three dimensions are the default: without a graphics card nothing is drawn in time.
  get startsIn3d() { return hasWebGL() === "card"; }

  // Where WebGL 2 is there, its cameras are offered; the scene is loaded with the first of them. The map shows the cars
  // until it is there, and is small then.
  offerCameras(asked = "") {
    if (this.setup.quiet || !hasWebGL()) return;
    this.offered = [...CAMERAS, MAP];
    const select = this.part("camera");
    select?.replaceChildren(...this.cameras.map((name) => new Option(this.words[name], name)));
    select?.addEventListener("change", () => { this.prefer(select.value); this.setCamera(select.value); });
    this.offerSelect(MAP);
    const wanted = [asked, this.preferred].find((name) => this.cameras.includes(name));
    const first = wanted ?? (this.startsIn3d && !navigator.connection?.saveData ? CAMERAS[0] : MAP);
    if (first !== MAP) this.setCamera(first);
  }

  offerSelect(name) {
    if (!this.part("camera")) return;
    this.part("camera").value = name;
    this.part("cameras").hidden = !this.cameras.length;
  }

  get preferred() { try { return localStorage.getItem("viewer-camera"); } catch { return null; } }

  prefer(name) { try { localStorage.setItem("viewer-camera", name); } catch { /* a browser that stores nothing */ } }

  // A view in three dimensions, made once; null where it cannot be drawn.
  async mountScene() {
    try {
      const { createScene } = await import("./scene.js");
      return createScene(this.part("scene"), this.replay, {
        calm: isStill(), onMoved: () => this.draw(),
        onLost: () => { this.lost = true; this.setCamera(MAP); this.note(this.words.contextLost); },
        onRestored: () => { this.lost = false; this.note(""); this.setCamera(this.last); },
      });
    } catch (error) {
      console.warn("no 3D view", error);
      return null;
    }
  }

  async setCamera(name) {
    const wants3d = name !== MAP && !this.lost;
    this.camera = wants3d ? name : MAP;
    this.offerSelect(this.camera);
    if (wants3d) {
      this.last = name;
      this.mounting ??= this.mountScene();
      this.scene = await this.mounting;
      if (this.camera === MAP) return; // changed meanwhile
    }
    const is3d = Boolean(wants3d && this.scene);
    if (wants3d && !is3d) {
      [this.camera, this.offered] = [MAP, []];
      this.offerSelect(MAP);
      this.note(this.words.no3d);
    }
    this.part("scene").hidden = !is3d;
    this.part("stage").classList.toggle("in-3d", is3d);
    this.views = is3d ? [this.scene, this.map] : [this.map];
    if (is3d) this.scene.setCamera(this.camera);
    this.views.forEach((view) => view.resize());
    this.remember?.();
    this.draw();
  }

  nextCamera() {
    if (this.cameras.length) this.setCamera(this.cameras[(this.cameras.indexOf(this.camera) + 1) % this.cameras.length]);
  }

  dispose() {
    this.resized.disconnect();
    for (const view of new Set([...this.views, this.map, this.scene])) view?.dispose();
  }
}
