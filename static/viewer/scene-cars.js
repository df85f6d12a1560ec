// Cars, ghosts, bots and boxes of the scene, and where each of them is at a moment.
import * as THREE from "../vendor/three.module.min.js";
import { canvasTexture } from "./scene-road.js";
import { paintOf, shellOf, wheelGeometry, wheelPaint } from "./scene-shells.js";

const NOSE_M = 0.14; // a trace has the car's nose, so far before its middle; of a bot it has the middle
const JUMP_M = 0.6; // a longer step is a reset
const GHOST = 0.45;
const BOT = { shell: "paddock", colour: "#4f7ea8" };
const BOX = [0.3, 0.4, 0.25]; // paddock/simulator/solids.py
const RAD = Math.PI / 180;

// Metres driven until step i, for the turning of wheels; `known` grows with a run that is being driven.
function drivenAt({ x, y }, known, i) {
  if (known.length > x.length) known.length = 0;
  for (let k = known.length; k <= i; k += 1) {
    const step = k ? Math.hypot(x[k] - x[k - 1], y[k] - y[k - 1]) : 0;
    known.push((known[k - 1] ?? 0) + (step > JUMP_M ? 0 : step));
  }
  return known[i];
}

function label(name, colour) {
  const texture = canvasTexture(512, 96, (pen, width, height) => {
    pen.font = "600 44px system-ui, sans-serif";
    let text = name;
    while (text.length > 3 && pen.measureText(text).width > width - 110) text = `${text.replace("…", "").slice(0, -1)}…`;
    const wide = pen.measureText(text).width + 76, left = (width - wide) / 2;
    pen.fillStyle = "rgba(10,14,20,.72)";
    pen.beginPath(); pen.roundRect(left, 14, wide, 68, 34); pen.fill();
    pen.fillStyle = colour; pen.beginPath(); pen.arc(left + 34, height / 2, 13, 0, 7); pen.fill();
    pen.fillStyle = "#fff"; pen.textBaseline = "middle"; pen.fillText(text, left + 58, height / 2 + 2);
  });
  const material = new THREE.SpriteMaterial({ map: texture, sizeAttenuation: false, depthTest: false, fog: false });
  const sprite = new THREE.Sprite(material);
  sprite.center.set(0.5, 0);
  sprite.renderOrder = 20;
  return sprite;
}

class Car {
  constructor(run, named) {
    const { look, ghost } = run;
    this.run = run;
    this.ghost = ghost;
    this.driven = [];
    const { geometry, wheels, height } = shellOf(look.shell);
    this.wheels = wheels;
    this.material = new THREE.MeshPhongMaterial({ map: paintOf(look.shell, look.colour), shininess: 70, specular: "#666d75" });
    this.body = new THREE.Mesh(geometry, this.material);
    this.root = new THREE.Group();
    this.root.add(this.body);
    if (named) {
      this.label = label(run.name, look.colour);
      this.label.position.set(0, 0, height + 0.09);
      this.root.add(this.label);
    }
    this.fade(ghost);
  }

  fade(ghost) {
    this.faded = ghost;
    Object.assign(this.material, { transparent: ghost, opacity: ghost ? GHOST : 1 });
    this.body.renderOrder = ghost ? 12 : 0;
  }

  at(ms) {
    const now = this.run.at(ms), { columns } = this.run, { root } = this, yaw = now.yaw * RAD;
    root.position.set(now.x - NOSE_M * Math.cos(yaw), now.y - NOSE_M * Math.sin(yaw), 0);
    root.rotation.z = yaw;
    this.now = now;
    const before = this.run.at(ms - 120), after = this.run.at(ms + 120);
    const turned = (((after.yaw - before.yaw + 540) % 360) + 360) % 360 - 180, glides = Math.hypot(after.x - before.x, after.y - before.y) < 1.2;
    // it leans a little out of a bend, and back when it speeds up
    this.body.rotation.x = glides ? Math.max(-0.07, Math.min(0.07, turned * RAD * now.v * 0.09)) : 0;
    this.body.rotation.y = glides ? Math.max(-0.025, Math.min(0.025, (before.v - after.v) * 0.03)) : 0;
    this.roll = drivenAt(columns, this.driven, now.i) + Math.min(JUMP_M, Math.hypot(now.x - columns.x[now.i], now.y - columns.y[now.i]));
    this.steer = (before.steer + now.steer + after.steer) / 3; // the commanded angle jumps; a wheel does not
    if (!this.ghost && this.faded !== now.done) this.fade(now.done);
  }

  dispose() {
    this.body.geometry.dispose();
    for (const material of [this.material, this.label?.material]) { material?.map.dispose(); material?.dispose(); }
  }
}

export class Cars {
  constructor({ runs, bots = [], boxes = [] }) {
    this.group = new THREE.Group();
    this.cars = runs.map((run) => new Car(run, runs.length > 1));
    for (const car of this.cars) this.group.add(car.root);
    this.addBots(bots);
    this.addBoxes(boxes);
    const rolling = (ghost) => this.cars.filter((car) => car.ghost === ghost).reduce((sum, car) => sum + car.wheels.length, 0);
    this.paint = wheelPaint();
    this.solidWheels = this.instanced(wheelGeometry(), new THREE.MeshPhongMaterial({ map: this.paint, shininess: 20 }), rolling(false) + this.botWheels);
    this.ghostWheels = this.instanced(wheelGeometry(), new THREE.MeshPhongMaterial({ map: this.paint, transparent: true, opacity: GHOST }), rolling(true));
    this.ghostWheels.renderOrder = 11;
    const blob = canvasTexture(64, 64, (pen) => {
      const dark = pen.createRadialGradient(32, 32, 6, 32, 32, 32);
      [[0, "rgba(0,0,0,.62)"], [0.55, "rgba(0,0,0,.42)"], [1, "rgba(0,0,0,0)"]].forEach(([stop, tone]) => dark.addColorStop(stop, tone));
      pen.fillStyle = dark; pen.fillRect(0, 0, 64, 64);
    });
    const soft = new THREE.MeshBasicMaterial({ map: blob, transparent: true, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -3, polygonOffsetUnits: -12 });
    this.shadows = this.instanced(new THREE.PlaneGeometry(1, 1), soft, this.cars.length + this.bots.length + this.boxes.length);
    this.shadows.renderOrder = 7;
    this.matrix = new THREE.Matrix4();
    this.spin = new THREE.Matrix4();
  }

  instanced(geometry, material, count) {
    const mesh = new THREE.InstancedMesh(geometry, material, Math.max(1, count));
    mesh.count = count;
    mesh.frustumCulled = false;
    this.group.add(mesh);
    return mesh;
  }

  addBots(bots) {
    const { geometry, wheels } = shellOf(BOT.shell);
    this.bots = bots.map((bot) => ({ bot, root: new THREE.Object3D(), wheels }));
    this.botWheels = bots.length * wheels.length;
    if (!bots.length) { geometry.dispose(); return; }
    this.botBodies = this.instanced(geometry, new THREE.MeshPhongMaterial({ map: paintOf(BOT.shell, BOT.colour), shininess: 40 }), bots.length);
  }

  addBoxes(boxes) {
    this.boxes = boxes.map(({ x, y, yaw }) => {
      const root = new THREE.Object3D();
      root.position.set(x, y, BOX[2] / 2);
      root.rotation.z = yaw * RAD;
      root.updateMatrix();
      return { root };
    });
    if (!boxes.length) return;
    const crate = canvasTexture(128, 128, (pen, size) => {
      pen.fillStyle = "#c98a3a"; pen.fillRect(0, 0, size, size);
      for (let k = 0; k < 4; k += 1) { pen.fillStyle = k % 2 ? "#bf7f30" : "#d29544"; pen.fillRect(0, 32 * k, size, 30); }
      pen.strokeStyle = "#7d4e17"; pen.lineWidth = 12; pen.strokeRect(6, 6, size - 12, size - 12);
      pen.beginPath(); pen.moveTo(8, size - 8); pen.lineTo(size - 8, 8); pen.stroke();
    });
    this.crates = this.instanced(new THREE.BoxGeometry(...BOX), new THREE.MeshPhongMaterial({ map: crate, shininess: 8 }), boxes.length);
    this.boxes.forEach(({ root }, i) => this.crates.setMatrixAt(i, root.matrix));
  }

  draw(ms) {
    const wheels = { solid: 0, ghost: 0 };
    const roll = (root, parts, distance, steer, mesh, from) => parts.forEach(({ x, y, radius, wide, steered }, k) => {
      this.spin.makeRotationZ(steered ? steer : 0).setPosition(x, y, radius);
      this.matrix.makeRotationY((distance / radius) % (2 * Math.PI)).scale({ x: radius, y: wide, z: radius });
      mesh.setMatrixAt(from + k, this.matrix.premultiply(this.spin).premultiply(root.matrix));
    });
    let shade = 0;
    const shadow = (root, long, wide) => {
      this.matrix.makeScale(long, wide, 1).setPosition(0, 0, 0.002 - root.position.z);
      this.shadows.setMatrixAt(shade, this.matrix.premultiply(root.matrix));
      shade += 1;
    };
    for (const car of this.cars) {
      car.at(ms);
      car.root.updateMatrix();
      const kind = car.ghost ? "ghost" : "solid", mesh = car.ghost ? this.ghostWheels : this.solidWheels;
      roll(car.root, car.wheels, car.roll, car.steer * RAD, mesh, wheels[kind]);
      wheels[kind] += car.wheels.length;
      if (!car.ghost) shadow(car.root, 0.46, 0.3);
    }
    this.bots.forEach((bot, k) => {
      const { x, y, yaw } = bot.bot.at(ms);
      bot.root.position.set(x, y, 0);
      bot.root.rotation.z = yaw * RAD;
      bot.root.updateMatrix();
      this.botBodies.setMatrixAt(k, bot.root.matrix);
      bot.far = (bot.far ?? 0) + Math.min(0.3, Math.hypot(x - (bot.x ?? x), y - (bot.y ?? y)));
      [bot.x, bot.y] = [x, y];
      roll(bot.root, bot.wheels, bot.far, 0, this.solidWheels, wheels.solid);
      wheels.solid += bot.wheels.length;
      shadow(bot.root, 0.46, 0.3);
    });
    for (const { root } of this.boxes) shadow(root, 0.42, 0.54);
    this.shadows.count = shade;
    for (const mesh of [this.solidWheels, this.ghostWheels, this.botBodies, this.shadows]) if (mesh) mesh.instanceMatrix.needsUpdate = true;
  }

  // The nose of a car as it is drawn: metres and degrees.
  placeOf(index) {
    const { root } = this.cars[index];
    root.updateMatrixWorld();
    const nose = root.localToWorld(new THREE.Vector3(NOSE_M, 0, 0));
    return { x: nose.x, y: nose.y, yaw: root.rotation.z / RAD };
  }

  dispose() {
    for (const car of this.cars) car.dispose();
    for (const mesh of [this.solidWheels, this.ghostWheels, this.botBodies, this.crates, this.shadows]) {
      mesh?.geometry.dispose(); mesh?.material.map.dispose(); mesh?.material.dispose(); mesh?.dispose();
    }
  }
}
