// Brings each viewer of a page to life: loads its documents, draws them from above or in three dimensions, and joins
// them with the controls. A run that ends while its page is open plays by itself and stops at its result.
import { Player, RATES } from "./player.js";
import { clock, isStill, Stage } from "./stage.js";
import { loadReplay } from "./store.js";

const SEEN_MS = 350; // between two frames of what the car saw
const LEAST_GAIN = 1; // s of a jump with shift
const JUMPS = { difference: "d", off_track: "o", overtake: "v", crash: "x" };
const CLIP_MS = 5000; // of a moment
const CLIP_CAMERAS = { map: "top", top: "follow", free: "chase" }; // those of a video that come nearest

// Calls `act` when what is on the page has been painted; soon where nothing is, because nobody looks. The mark is for
// benchmarks/comparing.py.
function afterPaint(act) {
  let isDone = false;
  const once = () => { if (!isDone) { isDone = true; performance.mark("viewer:painted"); act(); } };
  requestAnimationFrame(() => setTimeout(once));
  setTimeout(once, 300);
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

export class Viewer extends Stage {
  constructor(root, setup, replay, lost) {
    super(root, setup, replay);
    this.player = new Player(replay);
    if (root.parentElement?.querySelector("[data-seen]")) this.frame = new CameraFrame(root.parentElement);
    if (lost.length) this.note(lost.map(({ name, url }) => this.words.lost.replace("%s", name ?? url)).join(" "));
    this.controls();
    this.player.addEventListener("time", () => this.draw());
    this.player.addEventListener("change", () => this.showState());
    this.begin();
  }

  // Whether this is the viewer's own page.
  get isPage() { return location.pathname === this.setup.page; }

  get isPlaying() { return this.player.playing; }

  get startsIn3d() { return this.isPage || (!this.setup.page && super.startsIn3d); }

  // --- what is shown --------------------------------------------------------------------------------------------------
  draw() {
    const { now } = this.player;
    super.draw(now);
    const seek = this.part("seek");
    seek.value = now;
    const [run] = this.replay.runs;
    if (!run) return;
    const { lap, v, steer } = run.at(now);
    const who = this.replay.runs.length > 1 ? `${run.name} · ` : "";
    const text = `${who}${this.words.lap} ${lap} · ${clock(run.inLap(now))} · ${v.toFixed(1)} m/s · ${steer.toFixed(0)}°`;
    if (!this.result) this.part("out").textContent = text;
    seek.setAttribute("aria-valuetext", text);
    this.frame?.look(now + run.start);
  }

  showState() {
    const { playing, rate } = this.player;
    this.part("toggle").textContent = playing ? this.words.pause : this.words.play; // a label that changes needs no state beside it
    this.root.toggleAttribute("data-plays", playing);
    this.part("rate").value = String(rate);
    if (playing) this.result = false;
    else this.remember();
    this.draw();
  }

  // --- what the reader does ---------------------------------------------------------------------------------------------
  controls() {
    const { player } = this;
    this.part("seek").addEventListener("input", ({ target }) => { this.result = false; player.seek(target.value); });
    this.part("seek").addEventListener("change", () => this.remember());
    this.part("toggle").addEventListener("click", () => player.toggle());
    this.part("rate").addEventListener("change", ({ target }) => { player.rate = target.value; });
    this.root.querySelectorAll("[data-step]").forEach((button) => button.addEventListener("click", () => player.step(Number(button.dataset.step))));
    this.part("share")?.addEventListener("click", () => this.share());
    if (this.setup.clip) {
      this.part("clip").hidden = false;
      for (const before of ["pointerenter", "focus", "click"]) this.part("clip").addEventListener(before, ({ target }) => { target.href = this.clip; });
      this.part("clip").href = this.setup.clip;
    }
    this.part("player").hidden = this.setup.quiet;
    if (!this.setup.quiet) this.root.addEventListener("keydown", (event) => this.press(event));
    // a click plays, but not the end of a drag, which moves the free camera
    let from = null;
    this.part("stage").addEventListener("pointerdown", ({ x, y }) => { from = [x, y]; });
    this.part("stage").addEventListener("click", ({ x, y }) => { if (!this.setup.quiet && from && Math.hypot(x - from[0], y - from[1]) < 6) player.toggle(); });
  }

  // The time that can be chosen.
  offerTime() {
    if (Number.isFinite(this.replay.duration)) this.part("seek").max = this.replay.duration;
  }

  // The kinds of events that there are.
  offerJumps() {
    if (!Number.isFinite(this.replay.duration)) return;
    const kinds = new Set(this.replay.events.map(({ kind }) => kind));
    this.part("jumps").replaceChildren(...Object.keys(JUMPS).filter((kind) => kinds.has(kind)).map((kind) => {
      const button = document.createElement("button");
      Object.assign(button, { type: "button", className: "button quiet small", textContent: this.words[kind] });
      button.dataset.jump = kind;
      button.addEventListener("click", ({ shiftKey }) => this.jump(kind, shiftKey ? -1 : 1));
      return button;
    }));
  }

  show(replay) {
    this.player.replay = replay;
    super.show(replay);
    this.offerTime();
    this.offerJumps();
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
      " ": () => player.toggle(), k: () => player.toggle(), Home: () => player.seek(0), End: () => this.toEnd(),
      ArrowLeft: () => (shiftKey ? player.seek(player.now - far) : player.step(-1)), ",": () => player.step(-1),
      ArrowRight: () => (shiftKey ? player.seek(player.now + far) : player.step(1)), ".": () => player.step(1),
      "[": () => this.faster(-1), "]": () => this.faster(1), c: () => this.nextCamera(), f: () => this.fillScreen(),
      ...Object.fromEntries(Object.entries(JUMPS).map(([kind, letter]) => [letter, () => this.jump(kind, shiftKey ? -1 : 1)])),
    };
    const act = acts[key.length === 1 ? key.toLowerCase() : key];
    if (!act || (isButton && (key === " " || key === "Enter"))) return;
    event.preventDefault();
    act();
  }

  // The end of the first run; from there that of the last.
  toEnd() {
    const { duration } = this.replay.runs[0];
    this.player.seek(this.player.now < duration ? duration : this.replay.duration);
  }

  faster(by) {
    const at = RATES.findIndex((rate) => rate >= this.player.rate);
    this.player.rate = RATES[Math.min(Math.max(at + by, 0), RATES.length - 1)];
  }

  // --- a link to a moment -----------------------------------------------------------------------------------------------
  get address() {
    const address = new URL(this.isPage ? location.href : this.setup.page, location.href);
    address.searchParams.set("t", (this.player.now / 1000).toFixed(2).replace(/\.?0+$/, ""));
    if (this.cameras.length) address.searchParams.set("camera", this.camera);
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
    this.begun = true;
    this.offerTime();
    if (this.setup.quiet && !isStill()) {
      this.player.loop = true;
      this.player.play();
    }
    this.draw();
    afterPaint(() => { this.offerJumps(); this.offerCameras(query.get("camera") ?? ""); });
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
    super.dispose();
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

// Request the analysis of the laps when it comes into sight; on failure its link stays.
function showAnalysis(card) {
  new IntersectionObserver(async ([{ isIntersecting }], watcher) => {
    if (!isIntersecting) return;
    watcher.disconnect();
    const answer = await fetch(card.dataset.analysis).catch((error) => error);
    if (!answer.ok) return;
    const part = document.createElement("template");
    part.innerHTML = await answer.text(); // the site's own page
    card.replaceWith(part.content);
    await import("./telemetry.js");
  }, { rootMargin: "200px" }).observe(card);
}

const startAll = (isFresh) => document.querySelectorAll("[data-viewer]:not([data-started])").forEach((root) => start(root, isFresh));
startAll(false);
document.querySelectorAll("[data-analysis]").forEach(showAnalysis);
if (document.querySelector("[data-telemetry]")) import("./telemetry.js");
// It came in the place of the car that was on track.
document.addEventListener("htmx:afterSettle", () => startAll(true));
