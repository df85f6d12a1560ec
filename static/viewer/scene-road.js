// The ground of the scene, in metres, x and y as in a trace and z up: road with lines, kerbs, finish line, verge, grass.
import * as THREE from "../vendor/three.module.min.js";

const LINE_M = 0.0762; // border lines inside the road, as the simulator paints them
const DASH_M = 0.25, DASH_HALF_M = 0.012;
const CHECK_M = 0.07;
const KERB_M = 0.09, STONE_M = 0.16;
const VERGE_M = 0.3;
const BENT = 0.4; // 1/m: from this curvature on a bend has a kerb
const BETWEEN = 4, ROUNDED_M = 0.03; // points of a border's curve between two of its own, and the most it may differ
export const GRASS_Z = -0.012;

// A line with points on a curve through its own (Catmull and Rom), straight where the curve would leave it too far.
function rounded(line, closed) {
  const count = line.length, out = [];
  const at = (i) => (closed ? line[(i + count) % count] : line[Math.min(count - 1, Math.max(0, i))]);
  for (let i = 0; i < (closed ? count : count - 1); i += 1) {
    const [p, a, b, q] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
    for (let k = 0; k < BETWEEN; k += 1) {
      const s = k / BETWEEN;
      const flat = [0, 1].map((j) => a[j] + s * (b[j] - a[j]));
      const bent = [0, 1].map((j) => 0.5 * (2 * a[j] + s * (b[j] - p[j]) + s * s * (2 * p[j] - 5 * a[j] + 4 * b[j] - q[j])
        + s * s * s * (3 * a[j] - p[j] - 3 * b[j] + q[j])));
      out.push(Math.hypot(bent[0] - flat[0], bent[1] - flat[1]) <= ROUNDED_M ? bent : flat);
    }
  }
  if (!closed) out.push(line[count - 1]);
  return out;
}

// The road by distance: `place(metres, share)` lies `share` of the way from the left border (0) to the right one (1).
export class RoadLine {
  constructor({ centre, inner, outer, direction, closed, start, finish, begins = 0 }) {
    this.closed = closed;
    const [left, right] = direction === "ccw" ? [inner, outer] : [outer, inner];
    const fine = centre.length > 1500 ? (line) => line : (line) => rounded(line, closed);
    [this.left, this.right, this.centre] = [left, right, centre].map(fine);
    if (closed) for (const line of [this.left, this.right, this.centre]) line.push(line[0]);
    this.metres = [0];
    for (let i = 1; i < this.centre.length; i += 1) {
      const [a, b] = [this.centre[i - 1], this.centre[i]];
      this.metres.push(this.metres[i - 1] + Math.hypot(b[0] - a[0], b[1] - a[1]));
    }
    this.length = this.metres.at(-1);
    // where lines cross the road: an open one goes on before its start and beyond its finish
    this.lines = closed ? [begins] : [start, finish].map(({ x, y }) => this.nearest(x, y).metres);
    const every = [...this.left, ...this.right];
    const [xs, ys] = [0, 1].map((j) => every.map((p) => p[j]));
    const least = (v) => v.reduce((a, b) => Math.min(a, b)), most = (v) => v.reduce((a, b) => Math.max(a, b));
    this.bounds = [least(xs), least(ys), most(xs), most(ys)];
  }

  index(metres) {
    let low = 0, high = this.metres.length - 2;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.metres[middle] <= metres) low = middle; else high = middle - 1;
    }
    return low;
  }

  place(metres, share) {
    const d = this.closed ? ((metres % this.length) + this.length) % this.length : Math.min(this.length, Math.max(0, metres));
    const i = this.index(d), s = (d - this.metres[i]) / (this.metres[i + 1] - this.metres[i] || 1);
    const at = (line, j) => line[i][j] + s * (line[i + 1][j] - line[i][j]);
    return [0, 1].map((j) => at(this.left, j) + share * (at(this.right, j) - at(this.left, j)));
  }

  width(metres) {
    const [a, b] = [this.place(metres, 0), this.place(metres, 1)];
    return Math.hypot(b[0] - a[0], b[1] - a[1]);
  }

  heading(metres, reach = 0.1) {
    const [a, b] = [this.place(metres - reach, 0.5), this.place(metres + reach, 0.5)];
    return Math.atan2(b[1] - a[1], b[0] - a[0]);
  }

  // 1/m, positive to the left.
  bend(metres, reach = 0.25) {
    const turn = this.heading(metres + reach, reach) - this.heading(metres - reach, reach);
    return Math.atan2(Math.sin(turn), Math.cos(turn)) / (2 * reach);
  }

  // The distance of the nearest point of the centre line, and how far it is.
  nearest(x, y) {
    let best = Infinity, index = 0;
    for (let i = 0; i < this.centre.length; i += 1) {
      const dx = this.centre[i][0] - x, dy = this.centre[i][1] - y, square = dx * dx + dy * dy;
      if (square < best) { best = square; index = i; }
    }
    return { metres: this.metres[index], away: Math.sqrt(best), index };
  }
}

// Collects triangles with a colour for each corner and makes one mesh of them.
export class Triangles {
  constructor() { this.at = []; this.colours = []; this.uv = []; this.index = []; }

  corner(x, y, z, colour, alpha = 1, u = 0, v = 0) {
    this.at.push(x, y, z);
    this.colours.push(colour.r, colour.g, colour.b, alpha);
    this.uv.push(u, v);
    return this.at.length / 3 - 1;
  }

  // Four corners in the order left-near, right-near, right-far, left-far, seen from above.
  quad(corners, colour, alpha = 1) {
    const [a, b, c, d] = corners.map(([x, y, z = 0]) => this.corner(x, y, z, colour, alpha));
    this.index.push(a, b, c, a, c, d);
  }

  // Any geometry of three.js, moved by `matrix`, lit once: nothing of it moves.
  add(geometry, matrix, colour, light) {
    const flat = geometry.index ? geometry.toNonIndexed() : geometry;
    flat.applyMatrix4(matrix);
    flat.computeVertexNormals();
    const { position, normal } = flat.attributes, tone = new THREE.Color();
    for (let i = 0; i < position.count; i += 1) {
      const facing = normal.getX(i) * light.x + normal.getY(i) * light.y + normal.getZ(i) * light.z;
      tone.copy(colour).multiplyScalar(0.62 + 0.42 * Math.max(facing, -0.35));
      this.index.push(this.corner(position.getX(i), position.getY(i), position.getZ(i), tone));
    }
    geometry.dispose();
    if (flat !== geometry) flat.dispose();
  }

  mesh(material) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(this.at, 3));
    geometry.setAttribute("color", new THREE.Float32BufferAttribute(this.colours, 4));
    if (material.map) geometry.setAttribute("uv", new THREE.Float32BufferAttribute(this.uv, 2));
    geometry.setIndex(this.index);
    const mesh = new THREE.Mesh(geometry, material);
    mesh.matrixAutoUpdate = false;
    return mesh;
  }
}

export function canvasTexture(width, height, paint, repeat = false) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  paint(canvas.getContext("2d"), width, height);
  const texture = new THREE.CanvasTexture(canvas);
  if (repeat) texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  return texture;
}

// The same numbers for the same seed: a track looks alike each time.
export function numbers(seed) {
  let state = [...String(seed)].reduce((sum, letter) => (Math.imul(sum, 31) + letter.codePointAt(0)) | 0, 7);
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

const speckled = (low, high, dots, seed) => (pen, width, height) => {
  const next = numbers(seed), grey = () => Math.round(low + (high - low) * next());
  pen.fillStyle = `rgb(${[0, 0, 0].map(() => Math.round((low + high) / 2))})`;
  pen.fillRect(0, 0, width, height);
  for (let i = 0; i < dots; i += 1) {
    const g = grey();
    pen.fillStyle = `rgb(${g},${g},${g})`;
    pen.fillRect(next() * width, next() * height, 1 + 2 * next(), 1 + 2 * next());
  }
};

const grassy = (pen, width, height) => {
  const next = numbers("grass");
  pen.fillStyle = "rgb(205,208,196)";
  pen.fillRect(0, 0, width, height);
  for (let i = 0; i < 5200; i += 1) {
    const g = Math.round(150 + 105 * next());
    pen.strokeStyle = `rgba(${g},${g},${Math.round(g * 0.86)},.55)`;
    const x = next() * width, y = next() * height;
    pen.beginPath(); pen.moveTo(x, y); pen.lineTo(x + 4 * next() - 2, y - 2 - 5 * next()); pen.stroke();
  }
};

function roadMesh(line, look) {
  const road = new Triangles(), next = numbers("asphalt");
  const white = new THREE.Color(look.line), asphalt = new THREE.Color(look.asphalt), tone = new THREE.Color();
  let wave = 0;
  line.centre.forEach((_, i) => {
    const [lx, ly] = line.left[i], [rx, ry] = line.right[i];
    const wide = Math.hypot(rx - lx, ry - ly) || 1, share = Math.min(0.3, LINE_M / wide);
    wave += 0.12 * (0.12 * (next() - 0.5) - wave);
    tone.copy(asphalt).multiplyScalar(1 + wave);
    // asphalt a little darker where tyres run
    for (const [s, colour] of [[0, white], [share, white], [share, tone], [0.5, tone], [1 - share, tone], [1 - share, white], [1, white]]) {
      road.corner(lx + s * (rx - lx), ly + s * (ry - ly), 0, colour, 1, s * wide / 0.55, line.metres[i] / 0.55);
    }
    if (i === 0) return;
    const a = 7 * (i - 1), b = 7 * i;
    for (const k of [0, 2, 3, 5]) road.index.push(a + k, a + k + 1, b + k + 1, a + k, b + k + 1, b + k);
  });
  return road;
}

function marks(line, look) {
  const paint = new Triangles(), colour = new THREE.Color(look.dash);
  const count = Math.max(1, Math.round(line.length / (2 * DASH_M)));
  for (let k = 0; k < count; k += 1) {
    const from = (k * line.length) / count, parts = 3;
    for (let p = 0; p < parts; p += 1) {
      const ends = [from + (p * DASH_M) / parts, from + ((p + 1) * DASH_M) / parts];
      const [a, b] = ends.map((d) => DASH_HALF_M / line.width(d));
      paint.quad([line.place(ends[0], 0.5 - a), line.place(ends[0], 0.5 + a), line.place(ends[1], 0.5 + b), line.place(ends[1], 0.5 - b)], colour);
    }
  }
  const [dark, light] = [new THREE.Color("#14171b"), new THREE.Color(look.line)];
  for (const finish of line.lines) {
    const columns = Math.max(4, Math.round(line.width(finish) / CHECK_M));
    for (let row = -2; row < 1; row += 1) {
      for (let k = 0; k < columns; k += 1) {
        const [near, far, low, high] = [finish + row * CHECK_M, finish + (row + 1) * CHECK_M, k / columns, (k + 1) / columns];
        paint.quad([line.place(near, low), line.place(near, high), line.place(far, high), line.place(far, low)], (row + k) % 2 ? dark : light);
      }
    }
  }
  return paint;
}

// Red and white stones along the inner side of every bend.
function kerbs(line, look) {
  const stones = new Triangles(), count = Math.max(8, Math.round(line.length / STONE_M)), step = line.length / count;
  const colours = [new THREE.Color(look.kerb), new THREE.Color(look.line)];
  const sides = Array.from({ length: count }, (_, k) => {
    const bend = line.bend(k * step), wide = line.width(k * step);
    return Math.abs(bend) > BENT && Math.abs(bend) < 1 / (wide / 2 + KERB_M + 0.1) ? Math.sign(bend) : 0;
  });
  for (let k = 0; k < count; k += 1) {
    const side = sides[k];
    // no lonely stones
    if (!side || [1, 2, 3].filter((n) => sides[(k + n) % count] === side || sides[(k - n + count) % count] === side).length < 2) continue;
    const colour = colours[k % 2], dim = colour.clone().multiplyScalar(0.7);
    const rows = [k * step, (k + 1) * step].map((d) => {
      const wide = line.width(d), edge = side > 0 ? 0 : 1, out = side > 0 ? -KERB_M / wide : 1 + KERB_M / wide;
      return [[...line.place(d, edge), 0.001], [...line.place(d, out), 0.013], [...line.place(d, out), GRASS_Z]];
    });
    const faces = [[rows[0][0], rows[0][1], rows[1][1], rows[1][0]], [rows[0][1], rows[0][2], rows[1][2], rows[1][1]]];
    faces.forEach((face, n) => stones.quad(side > 0 ? face.reverse() : face, n ? dim : colour));
  }
  return stones;
}

// Worn ground beside the road, which fades into the grass.
function verge(line, look, plain) {
  const soil = new Triangles(), colour = new THREE.Color(look.verge), grass = new THREE.Color(look.grass);
  for (const side of [-1, 1]) {
    const first = soil.at.length / 3;
    line.centre.forEach((_, i) => {
      const share = VERGE_M / line.width(line.metres[i]), d = line.metres[i];
      const [near, far] = side < 0 ? [0, -share] : [1, 1 + share];
      const row = [[near, 0.95], [far, 0]].map(([s, alpha]) => soil.corner(...line.place(d, s), GRASS_Z + 0.004, plain && !alpha ? grass : colour, plain ? 1 : alpha));
      if (i === 0) return;
      const [a, b] = row, [p, q] = [first + 2 * (i - 1), first + 2 * (i - 1) + 1];
      if (side < 0) soil.index.push(q, p, a, q, a, b); else soil.index.push(p, q, b, p, b, a);
    });
  }
  return soil;
}

// A darker line where a run drove, as tyres leave it.
export function rubber(run, look) {
  const { x, y, yaw, lap } = run.columns, dark = new THREE.Color(look.rubber), band = new Triangles();
  const wanted = run.lap || Math.max(lap[0], lap.at(-1) - 1);
  let before = null;
  for (let i = 0; i < x.length; i += 1) {
    if (i && Math.hypot(x[i] - x[i - 1], y[i] - y[i - 1]) > 0.6) before = null;
    if (lap[i] !== wanted) continue;
    const a = (yaw[i] * Math.PI) / 180, [c, s] = [Math.cos(a), Math.sin(a)];
    const at = (side) => [x[i] - 0.14 * c - side * s, y[i] - 0.14 * s + side * c, 0];
    const now = [[0.2, 0], [0.08, 0.3], [-0.08, 0.3], [-0.2, 0]].map(([side, alpha]) => band.corner(...at(side), dark, alpha));
    if (before) for (const k of [0, 1, 2]) band.index.push(before[k], before[k + 1], now[k + 1], before[k], now[k + 1], now[k]);
    before = now;
  }
  return band;
}

function field(line, look) {
  const [x0, y0, x1, y1] = line.bounds, reach = 90, next = numbers("field");
  const size = Math.max(x1 - x0, y1 - y0) + 2 * reach;
  const plane = new THREE.PlaneGeometry(size, size, 56, 56);
  plane.translate((x0 + x1) / 2, (y0 + y1) / 2, GRASS_Z);
  const [grass, dry, haze] = [look.grass, look.dry, look.fog].map((tone) => new THREE.Color(tone)), tone = new THREE.Color(), colours = [];
  const { position, uv } = plane.attributes;
  for (let i = 0; i < position.count; i += 1) {
    const [x, y] = [position.getX(i), position.getY(i)], away = Math.hypot(Math.max(x0 - x, x - x1, 0), Math.max(y0 - y, y - y1, 0));
    tone.copy(grass).lerp(dry, 0.55 * next() ** 2).lerp(haze, 0.85 * Math.min(1, Math.max(0, (away - 6) / 36)));
    colours.push(tone.r, tone.g, tone.b);
    uv.setXY(i, position.getX(i) / 1.3, position.getY(i) / 1.3);
  }
  plane.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
  return plane;
}

// All meshes of the ground, in the order in which they hide each other best. `plain`: for a processor that draws.
export function groundOf(line, look, { plain, sharpness }) {
  const offset = (factor) => ({ polygonOffset: true, polygonOffsetFactor: -factor, polygonOffsetUnits: -4 * factor });
  const basic = (options) => new THREE.MeshBasicMaterial({ vertexColors: true, ...options });
  const tone = plain ? 0.86 : 1; // of a picture's mean
  const [asphalt, grass] = [speckled(196, 255, 9000, "stones"), grassy].map((paint) => {
    if (plain) return null;
    return Object.assign(canvasTexture(256, 256, paint, true), { anisotropy: sharpness });
  });
  const soil = plain ? basic({ side: THREE.DoubleSide, color: new THREE.Color(tone, tone, tone) }) : basic({ transparent: true, depthWrite: false, side: THREE.DoubleSide });
  const parts = [
    [roadMesh(line, look).mesh(basic({ map: asphalt, color: new THREE.Color(tone, tone, tone) })), 1],
    [kerbs(line, look).mesh(basic({ side: THREE.DoubleSide })), 0],
    [marks(line, look).mesh(basic(offset(1))), 2],
    [new THREE.Mesh(field(line, look), basic({ map: grass, color: new THREE.Color(tone, tone, tone) })), 4],
    [verge(line, look, plain).mesh(soil), plain ? 3 : 5],
  ];
  return parts.map(([mesh, order]) => Object.assign(mesh, { renderOrder: order, frustumCulled: false }));
}
