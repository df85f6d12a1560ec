// A replay in three dimensions: `createScene(canvas, replay, options)` draws its road, cars, ghosts, bots and boxes from
// one of five cameras. It reads moments from the replay's runs and keeps no clock of its own.
import * as THREE from "../vendor/three.module.min.js";
import { CAMERAS, Cameras } from "./scene-cameras.js";
import { Cars } from "./scene-cars.js";
import { RoadLine, groundOf, rubber } from "./scene-road.js";
import { skyOf, tracksideOf } from "./scene-trackside.js";
import { hasWebGL } from "./webgl.js";

export { CAMERAS };

const LOOKS = {
  light: {
    asphalt: "#5d6167", line: "#f3f3ee", dash: "#e3a72f", kerb: "#d3202f", verge: "#8f7f57", grass: "#79a04e", dry: "#98a95c", rubber: "#1c1d20",
    hills: ["#a9bfca", "#7d9a86"], leaves: ["#3f7a3a", "#4f8a3d", "#2f6a3c", "#6f9440"], bright: 1, shade: 0.45,
    sky: [[0, "#2e6fbd"], [0.3, "#76b0e2"], [0.46, "#cfe3f0"], [0.52, "#e8eff1"], [1, "#e8eff1"]], cloud: "rgba(255,255,255,.16)",
    fog: "#d7e4ea", near: 14, far: 95, sun: ["#fff4e0", 2.1], air: ["#dfeaf5", "#7d8a62", 1.9],
  },
  dark: {
    asphalt: "#3b4048", line: "#cfd5dc", dash: "#b98a2e", kerb: "#b01f33", verge: "#453f38", grass: "#3a5744", dry: "#495c46", rubber: "#08090b",
    hills: ["#38415f", "#27344a"], leaves: ["#23473a", "#2b5340", "#1d3d38", "#34563f"], bright: 0.8, shade: 0.6, stars: true,
    sky: [[0, "#070c1c"], [0.25, "#16244a"], [0.4, "#3d3f6e"], [0.47, "#8a5a72"], [0.5, "#c9805f"], [0.52, "#4a4660"], [1, "#4a4660"]], cloud: "rgba(170,120,150,.10)",
    fog: "#3c4058", near: 9, far: 70, sun: ["#ffd9b8", 1.5], air: ["#98a8d8", "#3a4038", 1.7],
  },
};

// Whether the page is dark: what it says, or else what the system says.
function isDark() {
  const said = document.documentElement.dataset.theme;
  return said ? said === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
}

export class SceneView {
  // options: camera, follow (number of a run), calm (reduced motion), dark, onLost, onRestored, onMoved (draw again).
  constructor(canvas, replay, options) {
    // colours as they are written: no conversion for each pixel
    THREE.ColorManagement.enabled = false;
    this.canvas = canvas;
    this.options = options;
    if (!hasWebGL()) throw new Error("no WebGL 2");
    this.software = options.plain ?? hasWebGL() === "software"; // then edges stay jagged and nothing is drawn twice
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.software, powerPreference: "high-performance", preserveDrawingBuffer: Boolean(options.keepPicture) });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.calm = options.calm ?? matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.follow = options.follow ?? 0;
    this.line = new RoadLine(replay.scene);
    this.cameras = new Cameras(this.line, { calm: this.calm, canvas, onMoved: options.onMoved });
    this.cameras.set(options.camera ?? "chase");
    this.stop = new AbortController();
    const on = (target, kind, act) => target.addEventListener(kind, act, { signal: this.stop.signal });
    on(canvas, "webglcontextlost", (event) => { event.preventDefault(); this.lost = true; options.onLost?.(); });
    on(canvas, "webglcontextrestored", () => { this.lost = false; options.onRestored?.(); });
    const themed = () => { if (options.dark === undefined && this.dark !== isDark()) { this.build(replay.scene); options.onMoved?.(); } };
    on(matchMedia("(prefers-color-scheme: dark)"), "change", themed);
    this.watch = new MutationObserver(themed);
    this.watch.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    this.document = replay.scene;
    this.build(replay.scene);
    this.resize();
  }

  // Everything but the cars, in the colours of the theme.
  build(document) {
    this.clear();
    this.dark = this.options.dark ?? isDark();
    const look = (this.look = LOOKS[this.dark ? "dark" : "light"]);
    this.world = new THREE.Scene();
    if (!this.software) this.world.fog = new THREE.Fog(look.fog, look.near, look.far);
    this.sky = skyOf(look, this.software);
    const ground = groundOf(this.line, look, { plain: this.software, sharpness: Math.min(8, this.renderer.capabilities.getMaxAnisotropy()) });
    this.world.add(this.sky, ...ground, ...tracksideOf(this.line, document, look));
    const sun = new THREE.DirectionalLight(...look.sun);
    sun.position.set(-4.5, -5, 7.4);
    const air = new THREE.HemisphereLight(...look.air);
    air.position.set(0, 0, 1);
    this.world.add(sun, air);
    this.runs = null;
  }

  fill(replay) {
    this.cars?.dispose();
    if (this.cars) this.world.remove(this.cars.group);
    this.runs = [...replay.runs];
    this.cars = new Cars(replay);
    this.world.add(this.cars.group);
    if (this.band) { this.world.remove(this.band); this.band.geometry.dispose(); }
    this.band = null;
    if (!this.runs.length || this.runs[0].grows) return;
    const soft = new THREE.MeshBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -8 });
    this.band = Object.assign(rubber(replay.line ?? this.runs[0], this.look).mesh(soft), { renderOrder: 6, frustumCulled: false });
    this.world.add(this.band);
  }

  draw(replay, ms) {
    if (this.lost) return;
    if (!this.runs || this.runs.length !== replay.runs.length || this.runs.some((run, i) => run !== replay.runs[i])) this.fill(replay);
    this.cars.draw(ms);
    const followed = this.cars.cars[Math.min(this.follow, this.cars.cars.length - 1)];
    if (followed) this.cameras.place(followed, ms, this.wide / this.high);
    else this.cameras.overview(this.wide / this.high);
    const close = ["chase", "onboard"].includes(this.cameras.name);
    const size = 0.075 * Math.tan((this.cameras.eye.fov * Math.PI) / 360) * Math.max(1, 420 / this.high) ;
    for (const car of this.cars.cars) {
      if (!car.label) continue;
      car.label.visible = !(close && car === followed) && !(car.now.done && car.ghost);
      car.label.scale.set((size * 512) / 96, size, 1);
    }
    // nothing stands between the camera and its car
    const { position } = this.cameras.eye;
    for (const car of this.cars.cars) car.root.visible = !close || car === followed || car.root.position.distanceTo(position) > 0.72;
    this.sky.position.copy(this.cameras.eye.position).setZ(0);
    this.renderer.render(this.world, this.cameras.eye);
  }

  resize() {
    const { canvas } = this;
    this.wide = canvas.clientWidth || canvas.width;
    this.high = canvas.clientHeight || canvas.height;
    this.renderer.setPixelRatio(this.options.pixelRatio ?? (this.software ? 1 : Math.min(2, devicePixelRatio || 1)));
    this.renderer.setSize(this.wide, this.high, false);
  }

  setCamera(name) { this.cameras.set(name); }

  setFollow(index) { this.follow = index; }

  // Where the nose of a car is drawn, in metres and degrees; for tests.
  placeOf(index) { return this.cars.placeOf(index); }

  clear() {
    this.cars?.dispose();
    this.cars = this.band = null;
    this.world?.traverse(({ geometry, material }) => {
      geometry?.dispose();
      material?.map?.dispose();
      material?.dispose();
    });
  }

  dispose() {
    this.stop.abort();
    this.watch.disconnect();
    this.cameras.stop();
    this.clear();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

export function createScene(canvas, replay, options = {}) {
  return new SceneView(canvas, replay, options);
}
