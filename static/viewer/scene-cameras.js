// The cameras of the scene: chase, onboard, top, trackside, free. Each but the free one follows from the moment alone, so
// that a jump in time shows the same picture as playing up to it.
import * as THREE from "../vendor/three.module.min.js";

export const CAMERAS = ["chase", "onboard", "top", "trackside", "free"];
const RAD = Math.PI / 180;
const LAG_MS = [0, 90, 180, 270, 360]; // the chase camera looks where the car went in the last third of a second
const POST_M = 5.5; // between two cameras beside the road

// Where along the road the cameras beside it stand.
export function postsOf(line) {
  const count = Math.max(4, Math.round(line.length / POST_M));
  return Array.from({ length: count }, (_, k) => ((k + 0.5) * line.length) / count);
}

export class Cameras {
  constructor(line, { calm, canvas, onMoved }) {
    this.line = line;
    this.calm = calm;
    this.canvas = canvas;
    this.onMoved = onMoved;
    this.eye = new THREE.PerspectiveCamera(55, 16 / 9, 0.06, 260);
    this.eye.up.set(0, 0, 1);
    this.aim = new THREE.Vector3();
    this.orbit = { turn: 0, tilt: 0.45, away: 1.8, aside: new THREE.Vector3() };
    this.posts = this.placePosts();
    this.name = "chase";
    this.listen();
  }

  set(name) {
    if (!CAMERAS.includes(name)) return;
    if (name === "free" && this.name !== "free" && this.car) { // from where it looks now
      const from = this.eye.position.clone().sub(this.car.root.position);
      this.orbit.away = Math.min(12, Math.max(0.7, from.length()));
      this.orbit.turn = Math.atan2(from.y, from.x);
      this.orbit.tilt = Math.min(1.5, Math.max(0.12, Math.asin(from.z / from.length())));
      this.orbit.aside.set(0, 0, 0);
    }
    this.name = name;
    this.canvas.style.touchAction = name === "free" ? "none" : "pan-y";
  }

  // Posts on the outer side of the road, at a height of a person's knee as a car of this size sees it.
  placePosts() {
    const { line } = this;
    return postsOf(line).map((metres) => {
      const out = line.bend(metres, 0.5) > 0 ? 1 : -1;
      const wide = line.width(metres);
      for (const [side, away] of [[out, 0.75], [-out, 0.75], [out, 0.45], [-out, 0.45]]) {
        const [x, y] = line.place(metres, side > 0 ? 1 + away / wide : -away / wide);
        if (line.nearest(x, y).away > wide / 2 + 0.3) return { metres, at: new THREE.Vector3(x, y, 0.42) };
      }
      const [x, y] = line.place(metres, 0.5);
      return { metres, at: new THREE.Vector3(x, y, 1.6) };
    });
  }

  place(car, ms, wide) {
    const { eye, aim } = this, { root, now } = car, tall = wide < 1;
    this.car = car;
    let fov = tall ? 68 : 52;
    const ahead = (yaw, metres, z) => new THREE.Vector3(Math.cos(yaw) * metres, Math.sin(yaw) * metres, z).add(root.position);
    eye.up.set(0, 0, 1);
    if (this.name === "onboard") {
      const yaw = root.rotation.z, lean = this.calm ? 0 : car.body.rotation.x * 0.5;
      eye.up.set(Math.sin(yaw) * lean, -Math.cos(yaw) * lean, 1);
      eye.position.copy(ahead(yaw, 0.04, 0.15)); // before masts and cages
      aim.copy(ahead(yaw, 1.4, -0.08));
      fov = tall ? 82 : 70;
    } else if (this.name === "top") {
      const away = tall ? 5.4 : 4.2;
      eye.position.set(root.position.x, root.position.y - 0.9, away);
      aim.copy(root.position);
    } else if (this.name === "trackside") {
      const post = this.postFor(now);
      eye.position.copy(post.at);
      aim.copy(root.position); aim.z = 0.06;
      fov = this.calm ? 46 : Math.min(62, Math.max(16, (2 * Math.atan(0.85 / eye.position.distanceTo(aim))) / RAD)) * (tall ? 1.3 : 1);
    } else if (this.name === "free") {
      const { turn, tilt, away, aside } = this.orbit;
      aim.copy(root.position).add(aside); aim.z = 0.08;
      eye.position.set(Math.cos(turn) * Math.cos(tilt), Math.sin(turn) * Math.cos(tilt), Math.sin(tilt)).multiplyScalar(away).add(aim);
    } else {
      const yaw = this.heading(car, ms), speed = this.calm ? 0 : now.v;
      eye.position.copy(ahead(yaw, tall ? -1.05 : -0.86, 0.4));
      aim.copy(ahead(yaw, 0.75, 0.06));
      fov += 2.2 * speed;
    }
    eye.fov = fov;
    eye.aspect = wide;
    eye.lookAt(aim);
    eye.updateProjectionMatrix();
  }

  // The whole track, before a car is there.
  overview(wide) {
    const { eye, aim } = this, [left, low, right, high] = this.line.bounds;
    aim.set((left + right) / 2, (low + high) / 2, 0);
    const away = 0.62 * Math.max((right - left) / Math.min(1.6, wide), high - low) + 1;
    eye.position.set(aim.x, aim.y - away, 0.9 * away);
    Object.assign(eye, { fov: 55, aspect: wide });
    eye.up.set(0, 0, 1);
    eye.lookAt(aim);
    eye.updateProjectionMatrix();
  }

  // The mean of the car's latest headings, not over a reset.
  heading({ run, root, now }, ms) {
    const yaw = root.rotation.z / RAD;
    let sum = 0, count = 0;
    for (const lag of LAG_MS) {
      const then = run.at(Math.max(0, ms - lag));
      if (Math.hypot(then.x - now.x, then.y - now.y) > 2.2) break;
      sum += ((((then.yaw - yaw + 540) % 360) + 360) % 360) - 180;
      count += 1;
    }
    return (yaw + sum / Math.max(1, count)) * RAD;
  }

  postFor({ x, y }) {
    const { metres } = this.line.nearest(x, y), step = this.line.length / this.posts.length;
    return this.posts[Math.min(this.posts.length - 1, Math.floor(metres / step))];
  }

  // The free camera by mouse, touch and keys.
  listen() {
    const { canvas, orbit } = this, held = new Map();
    const stop = new AbortController();
    this.stop = () => stop.abort();
    const on = (kind, act, options = {}) => canvas.addEventListener(kind, act, { signal: stop.signal, ...options });
    const moved = () => { this.onMoved?.(); };
    const turn = (dx, dy) => {
      orbit.turn -= dx * 0.006;
      orbit.tilt = Math.min(1.52, Math.max(0.05, orbit.tilt + dy * 0.005));
    };
    const zoom = (by) => { orbit.away = Math.min(30, Math.max(0.45, orbit.away * by)); };
    const shift = (dx, dy) => {
      const [c, s] = [Math.cos(orbit.turn), Math.sin(orbit.turn)], k = 0.0016 * orbit.away;
      orbit.aside.x += (dx * s - dy * c) * k; orbit.aside.y += (-dx * c - dy * s) * k;
    };
    on("pointerdown", (event) => {
      if (this.name !== "free") return;
      held.set(event.pointerId, event);
      canvas.setPointerCapture(event.pointerId);
    });
    on("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before || this.name !== "free") return;
      const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
      if (held.size === 2) {
        const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
        const far = (at) => Math.hypot(at.clientX - other.clientX, at.clientY - other.clientY);
        zoom(far(before) / Math.max(1, far(event)));
        shift(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons === 2) shift(dx, dy);
      else turn(dx, dy);
      held.set(event.pointerId, event);
      moved();
    });
    for (const kind of ["pointerup", "pointercancel"]) on(kind, (event) => held.delete(event.pointerId));
    on("contextmenu", (event) => { if (this.name === "free") event.preventDefault(); });
    on("wheel", (event) => {
      if (this.name !== "free") return;
      event.preventDefault();
      zoom(Math.exp(Math.sign(event.deltaY) * 0.12));
      moved();
    }, { passive: false });
    const keys = {
      ArrowLeft: () => turn(-20, 0), ArrowRight: () => turn(20, 0), ArrowUp: () => turn(0, 20), ArrowDown: () => turn(0, -20),
      "+": () => zoom(0.88), "=": () => zoom(0.88), "-": () => zoom(1.14), Home: () => orbit.aside.set(0, 0, 0),
    };
    on("keydown", (event) => {
      const act = this.name === "free" && !event.ctrlKey && !event.metaKey && !event.altKey && keys[event.key];
      if (!act) return;
      event.preventDefault();
      event.stopPropagation();
      act();
      moved();
    });
  }
}
