// Bodies of cars in three dimensions, made of the same two drawings of a shell that pages and videos show (shells.json):
// the side view gives the heights, the view from above the widths, and both are the paint.
import * as THREE from "../vendor/three.module.min.js";
import { canvasTexture } from "./scene-road.js";

const SHELLS = await (await fetch(new URL("shells.json", import.meta.url))).json();
const UNIT_M = 0.33 / 120, GROUND = 50, MIDDLE = 60;
const COVERED = "M-38-31H-20V31H-38ZM20-31H38V31H20Z"; // evaluation/appearance/shells.py
const AXLES = [28, 92, 10];
const AXLE = 14; // the greatest width of a wheel from above
const WHEEL = 1.12; // drawn wheels are a little smaller than the real ones
const OPEN = new Set(["formula", "kart", "buggy", "roadster"]); // a helmet is seen
const SCALE = 4, SIZE = 512, BELOW = 276; // pixels of the paint
const SWATCHES = ["body", "dark", "red", "white", "helmet"];

// The closed outlines of an SVG path of M, L, H, V, Q, T and Z in absolute coordinates.
export function outlines(path) {
  const words = (path.match(/[MLHVQTZ]|-?(?:\d+\.?\d*|\.\d+)/g) ?? []).reverse(), found = [];
  let command = "", place = [0, 0], handle = null;
  const pair = () => [Number(words.pop()), Number(words.pop())];
  while (words.length) {
    if (/[A-Z]/.test(words.at(-1))) {
      command = words.pop();
      if (command === "Z") { handle = null; continue; }
    }
    const from = place, points = [];
    if (command === "H") points.push([Number(words.pop()), from[1]]);
    else if (command === "V") points.push([from[0], Number(words.pop())]);
    else if (command === "Q" || command === "T") {
      const bend = command === "Q" ? pair() : [2 * from[0] - (handle ?? from)[0], 2 * from[1] - (handle ?? from)[1]];
      const to = pair();
      for (let k = 1; k <= 6; k += 1) {
        const s = k / 6, r = 1 - s;
        points.push([0, 1].map((j) => r * r * from[j] + 2 * r * s * bend[j] + s * s * to[j]));
      }
      handle = bend;
    } else points.push(pair());
    if (!"QT".includes(command)) handle = null;
    if (command === "M") { found.push([]); command = "L"; }
    found.at(-1).push(...points);
    place = points.at(-1);
  }
  return found;
}

// Least and greatest y of an outline at x.
function span(outline, x) {
  let low = Infinity, high = -Infinity;
  outline.forEach(([bx, by], i) => {
    const [ax, ay] = outline[(i + outline.length - 1) % outline.length];
    if (x < Math.min(ax, bx) - 1e-6 || x > Math.max(ax, bx) + 1e-6) return;
    const ys = Math.abs(bx - ax) < 1e-6 ? [ay, by] : [ay + ((x - ax) / (bx - ax)) * (by - ay)];
    low = Math.min(low, ...ys); high = Math.max(high, ...ys);
  });
  return [low, high];
}

const range = (outline, j) => [Math.min(...outline.map((p) => p[j])), Math.max(...outline.map((p) => p[j]))];
const swatch = (name) => [(SIZE - 16) / SIZE, 1 - (16 + 32 * SWATCHES.indexOf(name)) / SIZE];
const fromAbove = (x, y) => [((x / UNIT_M + MIDDLE) * SCALE) / SIZE, 1 - ((34 - y / UNIT_M) * SCALE) / SIZE];
const fromTheSide = (x, z) => [((x / UNIT_M + MIDDLE) * SCALE) / SIZE, 1 - (BELOW + (GROUND - z / UNIT_M) * SCALE) / SIZE];

// Collects corners with normals and paint, without an index.
class Parts {
  constructor() { this.at = []; this.normals = []; this.uv = []; }

  add(geometry, uvOf) {
    const flat = geometry.index ? geometry.toNonIndexed() : geometry;
    const { position, normal } = flat.attributes;
    for (let i = 0; i < position.count; i += 1) {
      const place = [position.getX(i), position.getY(i), position.getZ(i)];
      this.at.push(...place);
      this.normals.push(normal.getX(i), normal.getY(i), normal.getZ(i));
      this.uv.push(...uvOf(...place));
    }
    geometry.dispose();
  }

  // A skin over rows of points of equal length.
  skin(rows, uvOf) {
    const geometry = new THREE.BufferGeometry(), wide = rows[0].length, index = [];
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(rows.flat(2), 3));
    for (let r = 1; r < rows.length; r += 1) {
      for (let k = 1; k < wide; k += 1) {
        const [a, b, c, d] = [(r - 1) * wide + k - 1, (r - 1) * wide + k, r * wide + k, r * wide + k - 1];
        index.push(a, b, c, a, c, d);
      }
    }
    geometry.setIndex(index);
    geometry.computeVertexNormals();
    this.add(geometry, uvOf);
  }

  block([x0, x1], [y0, y1], [z0, z1], name) {
    const box = new THREE.BoxGeometry(x1 - x0, y1 - y0, z1 - z0);
    box.translate((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2);
    this.add(box, () => swatch(name));
  }

  geometry() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(this.at, 3));
    geometry.setAttribute("normal", new THREE.Float32BufferAttribute(this.normals, 3));
    geometry.setAttribute("uv", new THREE.Float32BufferAttribute(this.uv, 2));
    return geometry;
  }
}

function wheelsOf({ side, above }) {
  const [rear, front, radius] = side.wheels ?? AXLES, wheels = [];
  for (const outline of outlines(above.under ?? COVERED)) {
    const [x0, x1] = range(outline, 0), [y0, y1] = range(outline, 1), wide = Math.min(AXLE, y1 - y0);
    if (x1 - x0 < AXLE) continue; // a wing
    const x = (x0 + x1) / 2, near = [rear - MIDDLE, front - MIDDLE].find((axle) => Math.abs(axle - x) < 12);
    const sides = y1 - y0 > 2 * AXLE ? [y0 + wide / 2, y1 - wide / 2] : [(y0 + y1) / 2];
    for (const y of sides) wheels.push({ x: (near ?? x) * UNIT_M, y: -y * UNIT_M, radius: radius * UNIT_M * WHEEL, wide: wide * UNIT_M });
  }
  const foremost = Math.max(...wheels.map(({ x }) => x));
  return wheels.map((wheel) => ({ ...wheel, steered: wheel.x > foremost - 0.02 }));
}

function bodyOf(shell, { side, above }) {
  const parts = new Parts(), [profile] = outlines(side.body), [plan] = outlines(above.body);
  const [x0, x1] = range(profile, 0), [w0, w1] = range(plan, 0);
  const glass = outlines(side.glass ?? ""), belt = glass.length ? Math.max(...glass.flat().map(([, y]) => y)) : null;
  const stations = [...new Set([...profile.map(([x]) => x), ...Array.from({ length: 25 }, (_, k) => x0 + (k * (x1 - x0)) / 24)])]
    .sort((a, b) => a - b).filter((x, i, all) => i === 0 || x - all[i - 1] > 0.35);
  const rows = stations.map((x) => {
    const [high, low] = span(profile, Math.min(x1 - 0.01, Math.max(x0 + 0.01, x)));
    const at = Math.min(w1 - 0.4, Math.max(w0 + 0.4, x - MIDDLE)), wide = span(plan, at)[1] * UNIT_M;
    const [bottom, top] = [(GROUND - low) * UNIT_M, (GROUND - high) * UNIT_M];
    const shoulder = Math.min(top - 0.1 * (top - bottom), belt === null ? bottom + 0.7 * (top - bottom) : (GROUND - belt) * UNIT_M);
    const roof = wide * (1 - Math.min(0.3, 0.1 + 4 * (top - Math.max(shoulder, bottom)))), mx = (x - MIDDLE) * UNIT_M;
    const waist = Math.max(shoulder, bottom + 0.6 * (top - bottom) * (belt === null ? 1 : 0));
    const wall = [[0.9 * wide, bottom], [wide, bottom + 0.4 * (waist - bottom)], [0.97 * wide, waist], [roof, top - 0.06 * wide]];
    const lid = [[roof, top - 0.06 * wide], [0.7 * roof, top - 0.012 * wide], [0, top]];
    return { x: mx, wide, bottom, top, wall, lid };
  });
  const strip = (name, sign) => rows.map((row) => row[name].map(([y, z]) => [row.x, sign * y, z]));
  parts.skin(strip("wall", -1).map((row) => [...row].reverse()), (x, _, z) => fromTheSide(x, z));
  parts.skin(strip("wall", 1), (x, _, z) => fromTheSide(x, z));
  parts.skin(rows.map((row) => [...row.lid.map(([y, z]) => [row.x, y, z]), ...row.lid.slice(0, 2).reverse().map(([y, z]) => [row.x, -y, z])]),
    (x, y) => fromAbove(x, y));
  // both ends, closed, with their lights
  for (const [row, front] of [[rows[0], false], [rows.at(-1), true]]) {
    const half = row.wall.map(([y, z]) => [row.x, y, z]), other = row.wall.map(([y, z]) => [row.x, -y, z]);
    parts.skin(front ? [half, other] : [other, half], () => swatch("body"));
    const [z, y, h] = [row.bottom + 0.62 * (row.top - row.bottom), 0.68 * row.wide, 0.16 * (row.top - row.bottom)];
    for (const sign of row.wide > 0.02 ? [-1, 1] : []) {
      const reach = front ? [row.x - 0.012, row.x + 0.002] : [row.x - 0.002, row.x + 0.006];
      parts.block(reach, [sign * y - 0.24 * row.wide, sign * y + 0.24 * row.wide], [z - h, z + h], front ? "white" : "red");
    }
  }
  return { parts, rows };
}

// Wings, sills, masts and cages: the dark parts of the side view, as wide as the view from above has them there.
function addDarkParts(parts, rows, { side, above }) {
  const flat = [...outlines(above.dark ?? ""), ...outlines(above.under ?? "").filter((part) => range(part, 0)[1] - range(part, 0)[0] < AXLE)];
  for (const outline of outlines(side.dark ?? "")) {
    const [x0, x1] = range(outline, 0), [high, low] = range(outline, 1);
    const near = rows.filter(({ x }) => x >= (x0 - MIDDLE) * UNIT_M - 0.01 && x <= (x1 - MIDDLE) * UNIT_M + 0.01);
    const sill = low > 38 && x1 - x0 > 40;
    const found = flat.filter((part) => range(part, 0)[0] < x1 - MIDDLE && range(part, 0)[1] > x0 - MIDDLE && high < 38);
    let sides = found.map((part) => range(part, 1));
    if (sill) sides = [0.96, -0.96].map((sign) => near.map(({ wide }) => (wide / UNIT_M) * sign)).map((all) => Math.max(...all.map(Math.abs)))
      .map((wide) => [-wide, wide]).slice(0, 1);
    else if (!sides.length && low > 40) sides = [[-25, 25]];
    else if (!sides.length) sides = [[-3, 3]];
    const shape = new THREE.Shape(outline.map(([x, y]) => new THREE.Vector2((x - MIDDLE) * UNIT_M, (GROUND - y) * UNIT_M)));
    for (const [y0, y1] of sides) {
      const solid = new THREE.ExtrudeGeometry(shape, { depth: (y1 - y0) * UNIT_M, bevelEnabled: false });
      solid.rotateX(Math.PI / 2);
      solid.translate(0, y1 * UNIT_M, 0);
      parts.add(solid, () => swatch("dark"));
    }
  }
}

function addHelmet(parts, rows, above) {
  const [part] = outlines(above.dark ?? above.glass), x = ((range(part, 0)[0] + range(part, 0)[1]) / 2) * UNIT_M;
  const { top } = rows.reduce((best, row) => (Math.abs(row.x - x) < Math.abs(best.x - x) ? row : best));
  const ball = new THREE.SphereGeometry(0.02, 12, 9);
  ball.translate(x, 0, top + 0.012);
  parts.add(ball, () => swatch("helmet"));
  parts.block([x + 0.008, x + 0.021], [-0.013, 0.013], [top + 0.01, top + 0.02], "dark");
}

const made = new Map();
// The geometry of a shell's body and its wheels, in metres around the middle of the car; Paddock's for an unknown word.
export function shellOf(name) {
  const shell = name in SHELLS ? name : "paddock";
  if (!made.has(shell)) {
    const drawing = SHELLS[shell], { parts, rows } = bodyOf(shell, drawing);
    addDarkParts(parts, rows, drawing);
    if (OPEN.has(shell)) addHelmet(parts, rows, drawing.above);
    made.set(shell, { parts, wheels: wheelsOf(drawing), height: Math.max(...rows.map(({ top }) => top)) });
  }
  const { parts, wheels, height } = made.get(shell);
  return { geometry: parts.geometry(), wheels, height };
}

// The paint of a shell in a colour: both drawings, and plain colours for the rest.
export function paintOf(name, colour) {
  const { side, above } = SHELLS[name in SHELLS ? name : "paddock"];
  const glass = "#1b2733", dark = "#15181d";
  return canvasTexture(SIZE, SIZE, (pen) => {
    pen.fillStyle = colour;
    pen.fillRect(0, 0, SIZE, SIZE);
    const fill = (path, style) => { pen.fillStyle = style; pen.fill(new Path2D(path ?? "")); };
    pen.save();
    pen.scale(SCALE, SCALE);
    pen.translate(MIDDLE, 34);
    pen.fillStyle = "rgba(255,255,255,.85)"; // one broad stripe, as on racing cars
    pen.fillRect(-60, -4.6, 120, 1.6); pen.fillRect(-60, 3, 120, 1.6);
    fill(above.dark, dark); fill(above.glass, glass);
    pen.strokeStyle = "rgba(255,255,255,.22)"; pen.lineWidth = 0.7; pen.stroke(new Path2D(above.glass ?? ""));
    pen.restore();
    pen.save();
    pen.translate(0, BELOW);
    pen.scale(SCALE, SCALE);
    const shade = pen.createLinearGradient(0, 8, 0, 46);
    [[0, "rgba(255,255,255,.16)"], [0.45, "rgba(255,255,255,.04)"], [0.62, "rgba(0,0,0,.06)"], [1, "rgba(0,0,0,.42)"]]
      .forEach(([stop, tone]) => shade.addColorStop(stop, tone));
    pen.fillStyle = shade; pen.fillRect(0, 0, 120, 56);
    pen.fillStyle = "rgba(255,255,255,.8)"; pen.fillRect(0, 33.4, 120, 1.3);
    for (const x of (side.wheels ?? AXLES).slice(0, 2)) { // arches
      pen.fillStyle = "#0b0d10"; pen.beginPath(); pen.arc(x, GROUND - 10, 13, 0, 7); pen.fill();
    }
    fill(side.dark, dark); fill(side.glass, glass);
    pen.fillStyle = "rgba(255,255,255,.16)";
    pen.save(); pen.clip(new Path2D(side.glass ?? "")); pen.beginPath(); pen.moveTo(60, 0); pen.lineTo(72, 0); pen.lineTo(58, 56); pen.lineTo(46, 56); pen.fill(); pen.restore();
    pen.restore();
    [colour, dark, "#ff2a2a", "#fff8e0", "#f4f6f8"].forEach((tone, k) => { pen.fillStyle = tone; pen.fillRect(SIZE - 32, 32 * k, 32, 32); });
  });
}

// Tyre and rim for a cylinder's caps; its tread is the corner of the picture.
export function wheelGeometry() {
  const wheel = new THREE.CylinderGeometry(1, 1, 1, 18), tread = 2 * 19;
  for (let i = 0; i < tread; i += 1) wheel.attributes.uv.setXY(i, 0.01, 0.01);
  return wheel;
}

export const wheelPaint = () => canvasTexture(128, 128, (pen, size) => {
  const half = size / 2, disc = (radius, tone) => { pen.fillStyle = tone; pen.beginPath(); pen.arc(half, half, radius * half, 0, 7); pen.fill(); };
  pen.fillStyle = "#16181b"; pen.fillRect(0, 0, size, size);
  disc(0.98, "#1b1e22"); disc(0.68, "#c9d0d8"); disc(0.6, "#22262c");
  pen.strokeStyle = "#d6dce3"; pen.lineWidth = 10;
  for (let k = 0; k < 5; k += 1) {
    const a = (2 * Math.PI * k) / 5;
    pen.beginPath(); pen.moveTo(half, half); pen.lineTo(half + 0.62 * half * Math.cos(a), half + 0.62 * half * Math.sin(a)); pen.stroke();
  }
  disc(0.16, "#d6dce3");
});
