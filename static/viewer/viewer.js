// Brings each viewer of a page to life: loads its documents, draws them from above or in three dimensions, and joins
// them with the controls. A run that ends while its page is open plays by itself and stops at its result.
import { createFlatMap } from "./flat-map.js";
import { Player, RATES } from "./player.js";
import { loadReplay } from "./store.js";

const SEEN_MS = 350; // between two frames of what the car saw
const TOWER_MS = 200;
const LEAST_GAIN = 1; // s of a jump with shift
const JUMPS = { difference: "d", off_track: "o", overtake: "v", crash: "x" };
const CAMERAS = ["chase", "onboard", "top", "trackside", "free"];
const MAP = "map";
const CLIP_MS = 5000; // of a moment
const CLIP_CAMERAS = { map: "top", top: "follow", free: "chase" }; // those of a video that come nearest
const isStill = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

export function clock(ms) {
  const whole = Math.floor(ms);
  return `${Math.floor(whole / 60000)}:${String(Math.floor(whole / 1000) % 60).padStart(2, "0")}.${String(whole % 1000).padStart(3, "0")}`;
}

const seconds = (ms) => (ms === null ? "–" : `+${(ms / 1000).toFixed(3)}`);

// Whether a 3D view can be drawn here; looked for only once.
let webgl;
export function hasWebGL() {
  webgl ??= Boolean(document.createElement("canvas").getContext("webgl2"));
  return webgl;
}

// The frame of the car's camera at the moment: one request at a time, at most one each SEEN_MS, while it is in sight.
class CameraFrame {
  constructor(root) {
    this.image = root.querySelector("[data-seen]");
    this.link = root.querySelector("[data-saw]");
  }

  look(now) {
    this.now = Math.round(now);
    this.link.href = `${this.link.href.split("?")[0]}?ms=${this.now}`;
    if (this.busy || this.now === this.requested) return;
    this.busy = true;
    setTimeout(() => this.load(), SEEN_MS);
  }

  // A new source aborts the request before it, so the next frame waits until this one has loaded or failed.
  load() {
    const box = (this.image.hidden ? this.link : this.image).getBoundingClientRect();
    if (box.bottom < 0 || box.top > innerHeight) { this.busy = false; return; }
    this.requested = this.now;
    this.image.onload = this.image.onerror = () => { this.busy = false; this.look(this.now); };
    this.image.hidden = false;
    this.image.src = `${this.image.dataset.seen}?ms=${this.requested}`;
  }
}

export class Viewer {
  constructor(root, setup, replay, lost) {
    Object.assign(this, { root, setup, replay, words: setup.words, views: [], shown: {} });
    this.part = (name) => root.querySelector(`[data-${name}]`);
    this.player = new Player(replay);
    this.map = createFlatMap(this.part("map"), replay);
    this.views.push(this.map);
    if (root.parentElement?.querySelector("[data-seen]")) this.frame = new CameraFrame(root.parentElement);
    if (lost.length) this.note(lost.map(({ name, url }) => this.words.lost.replace("%s", name ?? url)).join(" "));
    this.controls();
    this.tower();
    this.player.addEventListener("time", () => this.draw());
    this.player.addEventListener("change", () => this.showState());
    this.resized = new ResizeObserver(() => { this.views.forEach((view) => view.resize()); this.draw(); });
    this.resized.observe(this.part("stage"));
    this.begin();
  }

  // Whether this is the viewer's own page.
  get isPage() { return location.pathname === this.setup.page; }

  note(text) {
    this.part("note").textContent = text;
    this.part("note").hidden = !text;
  }

  // --- what is shown --------------------------------------------------------------------------------------------------
  draw() {
    const { now } = this.player;
    for (const view of this.views) view.draw(this.replay, now);
    const seek = this.part("seek");
    seek.value = now;
    const [run] = this.replay.runs;
    const { lap, v, steer } = run.at(now);
    const who = this.replay.runs.length > 1 ? `${run.name} · ` : "";
    const text = `${who}${this.words.lap} ${lap} · ${clock(run.inLap(now))} · ${v.toFixed(1)} m/s · ${steer.toFixed(0)}°`;
    if (!this.result) this.part("out").textContent = text;
    seek.setAttribute("aria-valuetext", text);
    this.frame?.look(now + run.start);
    if (this.replay.runs.length > 1 && (!this.player.playing || Math.abs(now - (this.towerAt ?? -Infinity)) >= TOWER_MS)) this.drawTower(now);
  }

  showState() {
    const { playing, rate } = this.player;
    const toggle = this.part("toggle");
    toggle.textContent = playing ? this.words.pause : this.words.play;
    if (toggle.getAttribute("aria-pressed") !== String(playing)) toggle.setAttribute("aria-pressed", String(playing));
    this.part("rate").value = String(rate);
    if (playing) this.result = false;
    else this.remember();
    this.draw();
  }

  tower() {
    if (this.replay.runs.length < 2) return;
    this.part("tower").hidden = false;
    this.rows = this.replay.runs.map((run, number) => {
      const row = document.createElement("tr");
      row.dataset.run = number;
      row.classList.toggle("focus", number === 0);
      for (let cell = 0; cell < 6; cell += 1) row.append(document.createElement(cell === 1 ? "th" : "td"));
      row.cells[1].scope = "row";
      const dot = document.createElement("span");
      dot.className = "dot";
      dot.style.background = run.look.colour;
      row.cells[1].append(dot, run.name);
      row.cells[1].title = run.name;
      for (const cell of [0, 2, 3, 4, 5]) row.cells[cell].className = "num";
      return row;
    });
  }

  drawTower(now) {
    this.towerAt = now;
    const order = this.replay.order(now);
    const body = this.part("tower").querySelector("tbody");
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

  // --- what the reader does ---------------------------------------------------------------------------------------------
  controls() {
    const { player, words } = this;
    this.part("seek").max = this.replay.duration;
    this.part("seek").addEventListener("input", ({ target }) => { this.result = false; player.seek(target.value); });
    this.part("seek").addEventListener("change", () => this.remember());
    this.part("toggle").addEventListener("click", () => player.toggle());
    this.part("rate").addEventListener("change", ({ target }) => { player.rate = target.value; });
    this.root.querySelectorAll("[data-step]").forEach((button) => button.addEventListener("click", () => player.step(Number(button.dataset.step))));
    this.part("share").addEventListener("click", () => this.share());
    this.part("clip").hidden = !this.setup.clip;
    for (const before of ["pointerenter", "focus", "click"]) this.part("clip").addEventListener(before, ({ target }) => { target.href = this.clip; });
    this.part("clip").href = this.setup.clip;
    this.part("player").hidden = this.setup.quiet;
    const kinds = new Set(this.replay.events.map(({ kind }) => kind));
    for (const kind of Object.keys(JUMPS)) {
      if (!kinds.has(kind)) continue;
      const button = document.createElement("button");
      Object.assign(button, { type: "button", className: "button quiet small", textContent: words[kind] });
      button.dataset.jump = kind;
      button.addEventListener("click", ({ shiftKey }) => this.jump(kind, shiftKey ? -1 : 1));
      this.part("jumps").append(button);
    }
    if (!this.setup.quiet) this.root.addEventListener("keydown", (event) => this.press(event));
    // a click plays, but not the end of a drag, which moves the free camera
    let from = null;
    this.part("stage").addEventListener("pointerdown", ({ x, y }) => { from = [x, y]; });
    this.part("stage").addEventListener("click", ({ x, y }) => { if (!this.setup.quiet && from && Math.hypot(x - from[0], y - from[1]) < 6) player.toggle(); });
  }

  // Behind the last one, to the first again.
  jump(kind, way = 1) {
    if (this.player.jump(kind, way)) return;
    const of = this.replay.events.filter((event) => event.kind === kind);
    if (of.length) { this.player.pause(); this.player.seek(of[way > 0 ? 0 : of.length - 1].ms); }
  }

  press(event) {
    const { target, key, shiftKey } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || target.closest("select, a, [data-free-keys]")) return;
    const { player } = this;
    const isButton = target.closest("button");
    const far = 1000 * LEAST_GAIN;
    const acts = {
      " ": () => player.toggle(), k: () => player.toggle(), Home: () => player.seek(0), End: () => player.seek(this.replay.duration),
      ArrowLeft: () => (shiftKey ? player.seek(player.now - far) : player.step(-1)), ",": () => player.step(-1),
      ArrowRight: () => (shiftKey ? player.seek(player.now + far) : player.step(1)), ".": () => player.step(1),
      "[": () => this.faster(-1), "]": () => this.faster(1), c: () => this.nextCamera(),
      ...Object.fromEntries(Object.entries(JUMPS).map(([kind, letter]) => [letter, () => this.jump(kind, shiftKey ? -1 : 1)])),
    };
    const act = acts[key.length === 1 ? key.toLowerCase() : key];
    if (!act || (isButton && (key === " " || key === "Enter"))) return;
    event.preventDefault();
    act();
  }

  faster(by) {
    const at = RATES.findIndex((rate) => rate >= this.player.rate);
    this.player.rate = RATES[Math.min(Math.max(at + by, 0), RATES.length - 1)];
  }

  // --- cameras ------------------------------------------------------------------------------------------------------------
  // Where WebGL 2 is there, its cameras are offered; the scene is loaded with the first of them. The map is small then.
  offerCameras() {
    if (this.setup.quiet || !hasWebGL()) return;
    const select = this.part("camera");
    select.replaceChildren(...[...CAMERAS, MAP].map((name) => new Option(this.words[name], name)));
    select.value = MAP;
    select.addEventListener("change", () => { this.prefer(select.value); this.setCamera(select.value); });
    this.part("cameras").hidden = false;
    const wanted = [this.asked, this.preferred].find((name) => name === MAP || CAMERAS.includes(name));
    const first = wanted ?? (this.isPage && !navigator.connection?.saveData ? CAMERAS[0] : MAP);
    if (first !== MAP) this.setCamera(first);
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

  get camera() { return this.part("camera").value || MAP; }

  async setCamera(name) {
    const wants3d = name !== MAP && !this.lost;
    this.part("camera").value = wants3d ? name : MAP;
    if (wants3d) {
      this.last = name;
      this.part("scene").hidden = false;
      this.part("stage").classList.add("in-3d");
      this.mounting ??= this.mountScene();
      this.scene = await this.mounting;
      if (this.camera === MAP) return; // changed meanwhile
    }
    const is3d = Boolean(wants3d && this.scene);
    if (wants3d && !is3d) {
      this.part("cameras").hidden = true;
      this.part("camera").value = MAP;
      this.note(this.words.no3d);
    }
    this.part("scene").hidden = !is3d;
    this.part("stage").classList.toggle("in-3d", is3d);
    this.views = is3d ? [this.scene, this.map] : [this.map];
    if (is3d) { this.scene.setCamera(this.camera); this.scene.resize(); }
    this.remember();
    this.draw();
  }

  nextCamera() {
    if (this.part("cameras").hidden) return;
    const names = [...CAMERAS, MAP];
    this.setCamera(names[(names.indexOf(this.camera) + 1) % names.length]);
  }

  // --- a link to a moment -----------------------------------------------------------------------------------------------
  get address() {
    const address = new URL(this.isPage ? location.href : this.setup.page, location.href);
    address.searchParams.set("t", (this.player.now / 1000).toFixed(2).replace(/\.?0+$/, ""));
    if (!this.part("cameras").hidden) address.searchParams.set("camera", this.camera);
    address.hash = "";
    return decodeURIComponent(address.href);
  }

  // The form of a clip of the first car, filled in with the lap, the moment and the camera.
  get clip() {
    const address = new URL(this.setup.clip, location.href);
    const [run] = this.replay.runs;
    const middle = Math.min(Math.max(this.player.now, CLIP_MS / 2), Math.max(CLIP_MS / 2, run.duration - CLIP_MS / 2));
    const [from, to] = [middle - CLIP_MS / 2, Math.min(middle + CLIP_MS / 2, run.duration)].map((ms) => Math.floor((run.start + ms) / 10) / 100);
    const camera = this.part("cameras").hidden ? "follow" : CLIP_CAMERAS[this.camera] ?? this.camera;
    address.search = new URLSearchParams({ what: `${run.number}:${run.at(this.player.now).lap}`, camera, from, to });
    address.hash = "video";
    return address.href;
  }

  // The address of the viewer's own page has the moment where it was paused.
  remember() {
    if (this.begun && this.isPage && this.player.now > 0) history.replaceState(history.state, "", this.address);
  }

  async share() {
    const url = this.address;
    if (navigator.share && matchMedia("(pointer: coarse)").matches) { await navigator.share({ url }).catch(() => {}); return; }
    try { await navigator.clipboard.writeText(url); this.note(this.words.copied); } catch { this.note(url); }
    setTimeout(() => this.note(""), 4000);
  }

  begin() {
    const query = new URLSearchParams(this.isPage ? location.search : "");
    this.player.seek(1000 * Number(query.get("t") ?? 0));
    this.asked = query.get("camera") ?? "";
    this.begun = true;
    this.offerCameras();
    if (this.setup.quiet && !isStill()) {
      this.player.loop = true;
      this.player.play();
    }
    this.draw();
  }

  // --- a run that has just ended ----------------------------------------------------------------------------------------
  // The whole run at 8x, unless the reader takes over or wants nothing to move.
  watch(result) {
    if (isStill()) { this.land(result); return; }
    let isWatched = true;
    for (const taken of ["pointerdown", "keydown", "wheel", "touchmove"]) {
      addEventListener(taken, () => { isWatched = false; }, { once: true, passive: true });
    }
    this.player.rate = 8;
    this.player.addEventListener("end", () => this.land(result, isWatched), { once: true });
    this.root.scrollIntoView({ block: "center" });
    this.player.play();
  }

  land(result, isWatched = false) {
    this.player.seek(this.replay.duration);
    this.player.rate = 1;
    this.result = true;
    this.part("out").textContent = result;
    this.root.dataset.landed = "";
    if (isWatched) document.getElementById("evaluation")?.scrollIntoView({ block: "start" });
  }

  dispose() {
    this.player.pause();
    this.resized.disconnect();
    for (const view of new Set([...this.views, this.map, this.scene])) view?.dispose();
  }
}

async function start(root, isFresh) {
  root.dataset.started = "yes";
  const setup = JSON.parse(root.dataset.viewer);
  try {
    const { replay, lost } = await loadReplay(setup);
    if (!replay.runs.length) return;
    const viewer = root.viewer = new Viewer(root, setup, replay, lost);
    root.dispatchEvent(new CustomEvent("viewer:ready", { bubbles: true, detail: viewer }));
    const { result } = root.closest("[data-result]")?.dataset ?? {};
    if (isFresh && result) viewer.watch(result);
  } catch (error) {
    const note = root.querySelector("[data-note]");
    note.textContent = setup.words.failed;
    note.hidden = false;
    if (!(error instanceof Error) || !("status" in error)) throw error;
  }
}

const startAll = (isFresh) => document.querySelectorAll("[data-viewer]:not([data-started])").forEach((root) => start(root, isFresh));
startAll(false);
// It came in the place of the car that was on track.
document.addEventListener("htmx:afterSettle", () => startAll(true));
