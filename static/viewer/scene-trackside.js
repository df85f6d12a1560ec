// What stands around the road: sky, hills, trees, tyre walls, boards, a stand and the arch over the finish line. All of
// it is one lit mesh and a few pictures; nothing of it moves.
import * as THREE from "../vendor/three.module.min.js";
import { postsOf } from "./scene-cameras.js";
import { GRASS_Z, Triangles, canvasTexture, numbers } from "./scene-road.js";

const LIGHT = new THREE.Vector3(-0.45, -0.5, 0.74).normalize();
const at = (x, y, z, yaw = 0, size = [1, 1, 1]) => new THREE.Matrix4().makeRotationZ(yaw).scale(new THREE.Vector3(...size)).setPosition(x, y, z);

// A dome: with clouds and stars, or, `plain`, in bare colours.
export function skyOf(look, plain) {
  const dome = new THREE.SphereGeometry(200, 32, 40).rotateX(Math.PI / 2);
  const finish = (material) => Object.assign(new THREE.Mesh(dome, material), { renderOrder: 6, frustumCulled: false });
  const common = { side: THREE.BackSide, fog: false, depthWrite: false };
  if (plain) {
    const { position, uv } = dome.attributes, colours = [];
    for (let i = 0; i < position.count; i += 1) {
      const down = 1 - uv.getY(i), next = Math.max(1, look.sky.findIndex(([stop]) => stop >= down));
      const [[from, low], [to, high]] = [look.sky[next - 1], look.sky[next]];
      const tone = new THREE.Color(low).lerp(new THREE.Color(high), (down - from) / (to - from));
      colours.push(tone.r, tone.g, tone.b);
    }
    dome.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
    return finish(new THREE.MeshBasicMaterial({ vertexColors: true, ...common }));
  }
  const texture = canvasTexture(1024, 512, (pen, width, height) => {
    const air = pen.createLinearGradient(0, 0, 0, height);
    look.sky.forEach(([stop, tone]) => air.addColorStop(stop, tone));
    pen.fillStyle = air; pen.fillRect(0, 0, width, height);
    const next = numbers("clouds");
    if (look.stars) {
      for (let k = 0; k < 260; k += 1) {
        pen.fillStyle = `rgba(255,255,255,${0.15 + 0.6 * next()})`;
        pen.fillRect(next() * width, next() * height * 0.42, 1.3, 1.3);
      }
    }
    for (let k = 0; k < 26; k += 1) {
      const [x, y, size] = [next() * width, height * (0.24 + 0.2 * next()), 22 + 46 * next()];
      for (let n = 0; n < 9; n += 1) {
        const [cx, cy, r] = [x + (next() - 0.5) * 3.4 * size, y + (next() - 0.5) * 0.34 * size, size * (0.3 + 0.4 * next())];
        for (const wrap of [-width, 0, width]) {
          const puff = pen.createRadialGradient(cx + wrap, cy, 0, cx + wrap, cy, r);
          puff.addColorStop(0, look.cloud); puff.addColorStop(1, look.cloud.replace(/[\d.]+\)$/, "0)"));
          pen.fillStyle = puff;
          pen.fillRect(cx + wrap - r, cy - r * 0.5, 2 * r, r);
        }
      }
    }
  });
  texture.wrapS = THREE.RepeatWrapping;
  return finish(new THREE.MeshBasicMaterial({ map: texture, ...common }));
}

function addHills(solid, line, look) {
  const [x0, y0, x1, y1] = line.bounds, next = numbers("hills"), reach = Math.hypot(x1 - x0, y1 - y0) / 2;
  const centre = [(x0 + x1) / 2, (y0 + y1) / 2], count = 72;
  [[reach + 34, 5, look.hills[1]], [reach + 58, 11, look.hills[0]]].forEach(([radius, high, tone], ring) => {
    const colour = new THREE.Color(tone), heights = Array.from({ length: count }, () => high * (0.35 + 0.65 * next()));
    for (let k = 0; k < count; k += 1) {
      const [a, b] = [k, k + 1].map((n) => ((n + 0.5 * ring) / count) * 2 * Math.PI);
      const spot = (angle, z) => [centre[0] + Math.cos(angle) * radius, centre[1] + Math.sin(angle) * radius, z];
      solid.quad([spot(b, -1), spot(a, -1), spot(a, heights[k]), spot(b, heights[(k + 1) % count])], colour);
    }
  });
}

function addTree(solid, x, y, size, look, next) {
  const bark = new THREE.Color("#5b4432"), green = new THREE.Color(look.leaves[Math.floor(next() * look.leaves.length)]);
  solid.add(new THREE.CylinderGeometry(0.05, 0.08, 0.7, 5).rotateX(Math.PI / 2), at(x, y, 0.3 * size, 0, [size, size, size]), bark, LIGHT);
  if (next() < 0.55) { // a fir
    [[0.62, 0.75, 0.5], [0.48, 1.2, 0.5], [0.32, 1.6, 0.5]].forEach(([radius, z]) =>
      solid.add(new THREE.ConeGeometry(radius, 0.85, 7).rotateX(Math.PI / 2), at(x, y, z * size, next() * 6, [size, size, size]), green, LIGHT));
  } else {
    [[0, 0, 1.05, 0.55], [0.26, 0.16, 0.85, 0.38], [-0.22, -0.14, 0.9, 0.4]].forEach(([dx, dy, z, radius]) =>
      solid.add(new THREE.IcosahedronGeometry(radius, radius > 0.5 ? 1 : 0), at(x + dx * size, y + dy * size, z * size, next() * 6, [size, size, size * 0.9]), green, LIGHT));
  }
}

// A place beside the road that no other part of the road is near to, or null.
function free(line, x, y, away) {
  const near = line.nearest(x, y);
  return near.away > line.width(near.metres) / 2 + away;
}

function addTrees(solid, shade, line, look, next) {
  const [x0, y0, x1, y1] = line.bounds, wide = x1 - x0 + 22, high = y1 - y0 + 22;
  const wanted = Math.min(120, Math.round(14 + wide * high * 0.055));
  for (let k = 0, tried = 0; k < wanted && tried < 6 * wanted; tried += 1) {
    const [x, y, size] = [x0 - 11 + wide * next(), y0 - 11 + high * next(), 0.75 + 0.75 * next()];
    if (!free(line, x, y, 1 + 0.5 * size)) continue;
    addTree(solid, x, y, size, look, next);
    shade.push([x, y, 1.5 * size]);
    k += 1;
  }
}

// Walls of tyres on the outer side of the bends.
function addTyres(solid, shade, line, look) {
  const colours = ["#1d1f23", look.kerb, "#1d1f23", "#e4e8ec"].map((tone) => new THREE.Color(tone)), away = 0.52;
  let last = null, walked = 0;
  for (let d = 0, count = 0; d < line.length && count < 380; d += 0.02) {
    const bend = line.bend(d, 0.45);
    if (Math.abs(bend) < 0.5) { last = null; continue; }
    const wide = line.width(d), [x, y] = line.place(d, bend > 0 ? 1 + away / wide : -away / wide);
    const step = last ? Math.hypot(x - last[0], y - last[1]) : 1;
    if (step < 0.128 || !free(line, x, y, away - 0.1)) continue;
    if (step < 0.5) walked += step;
    last = [x, y];
    const colour = colours[Math.floor(walked / 0.64) % 4];
    for (const [z, radius] of [[0.03, 0.064], [0.09, 0.06]]) {
      solid.add(new THREE.CylinderGeometry(radius * 0.9, radius, 0.058, 7, 1, true).rotateX(Math.PI / 2), at(x, y, z + GRASS_Z, d * 7 + z), colour, LIGHT);
    }
    solid.add(new THREE.CircleGeometry(0.054, 7), at(x, y, 0.119 + GRASS_Z, d * 7 + 0.09), colour, LIGHT);
    count += 1;
    if (count % 2) shade.push([x, y, 0.32]);
  }
}

// Flat pictures that stand: [x, y, z, yaw, width, height, cell]; cells of one atlas, seen from both sides.
function picturesMesh(list, texture) {
  const corners = new Triangles(), white = new THREE.Color("#fff");
  for (const { x, y, z, yaw, wide, high, cell: [u0, v0, u1, v1] } of list) {
    const [c, s] = [Math.cos(yaw) * wide / 2, Math.sin(yaw) * wide / 2];
    for (const back of [false, true]) {
      const [l, r] = back ? [1, -1] : [-1, 1];
      const ids = [[l, 0, u0, v0], [r, 0, u1, v0], [r, high, u1, v1], [l, high, u0, v1]]
        .map(([side, up, u, v]) => corners.corner(x + side * c, y + side * s, z + up, white, 1, u, v));
      corners.index.push(ids[0], ids[1], ids[2], ids[0], ids[2], ids[3]);
    }
  }
  return corners.mesh(new THREE.MeshBasicMaterial({ map: texture, vertexColors: true }));
}

const BOARDS = [["PADDOCK", "#c8102e", "#ffffff"], ["PADDOCK", "#ffffff", "#10151c"], ["RL RACING LEAGUE", "#10151c", "#ffffff"], ["PADDOCK", "#0b5cad", "#ffffff"]];

function atlas(name, look) {
  return canvasTexture(1024, 512, (pen) => {
    const text = (words, x, y, size, wide) => {
      pen.font = `italic 800 ${size}px system-ui, sans-serif`; pen.textAlign = "center"; pen.textBaseline = "middle";
      pen.fillText(words, x, y, wide);
    };
    BOARDS.forEach(([words, ground, ink], k) => {
      const [x, y] = [512 * (k % 2), 80 * Math.floor(k / 2)];
      pen.fillStyle = ground; pen.fillRect(x, y, 512, 80);
      pen.fillStyle = ink; text(words, x + 256, y + 42, 54, 470);
    });
    // the arch: checks, and the name of the track
    pen.fillStyle = "#10151c"; pen.fillRect(0, 160, 1024, 96);
    for (let k = 0; k < 8; k += 1) for (let n = 0; n < 4; n += 1) {
      pen.fillStyle = (k + n) % 2 ? "#fff" : "#10151c";
      for (const left of [0, 1024 - 192]) pen.fillRect(left + 24 * k, 160 + 24 * n, 24, 24);
    }
    pen.fillStyle = "#fff"; text(name, 512, 210, 56, 600);
    for (let k = 0; k < 30; k += 1) { // numbers of the turns
      const [x, y] = [102 * (k % 10), 262 + 64 * Math.floor(k / 10)];
      pen.fillStyle = "#fff"; pen.fillRect(x, y, 62, 62);
      pen.fillStyle = look.kerb; pen.fillRect(x, y, 62, 7); pen.fillRect(x, y + 55, 62, 7);
      pen.fillStyle = "#10151c"; text(String(k + 1), x + 29, y + 33, 40, 52);
    }
    const next = numbers("crowd"), tones = ["#e4572e", "#f3f3f3", "#2e86ab", "#f6c445", "#3a3f47", "#c33149", "#8fb339", "#d8a47f"];
    pen.fillStyle = "#2b3038"; pen.fillRect(0, 456, 1024, 56);
    for (let k = 0; k < 1500; k += 1) {
      pen.fillStyle = tones[Math.floor(next() * tones.length)];
      pen.beginPath(); pen.arc(next() * 1024, 460 + 48 * next(), 3.2, 0, 7); pen.fill();
    }
  });
}
const cell = (x, y, w, h) => [x / 1024, 1 - (y + h) / 512, (x + w) / 1024, 1 - y / 512];

function addArch(solid, pictures, line, look) {
  const metres = line.lines.at(-1), yaw = line.heading(metres), wide = line.width(metres) + 0.5, [x, y] = line.place(metres, 0.5);
  const steel = new THREE.Color("#3a4049"), across = [-Math.sin(yaw), Math.cos(yaw)];
  for (const side of [-0.5, 0.5]) {
    const [px, py] = [x + across[0] * side * wide, y + across[1] * side * wide];
    solid.add(new THREE.BoxGeometry(0.07, 0.07, 0.86), at(px, py, 0.43, yaw), steel, LIGHT);
    solid.add(new THREE.BoxGeometry(0.2, 0.2, 0.05), at(px, py, 0.02, yaw), new THREE.Color(look.kerb), LIGHT);
  }
  solid.add(new THREE.BoxGeometry(0.05, wide, 0.17), at(x, y, 0.84, yaw), steel, LIGHT);
  for (const side of [-1, 1]) {
    pictures.push({ x: x + side * 0.031 * Math.cos(yaw), y: y + side * 0.031 * Math.sin(yaw), z: 0.755, yaw: yaw + side * Math.PI / 2, wide, high: 0.17, cell: cell(0, 160, 1024, 96) });
  }
}

function addBoards(pictures, shade, line) {
  let last = -9;
  const posts = postsOf(line); // no board hides the road from a camera
  for (let d = 1.2, k = 0; d < line.length - 1; d += 0.2) {
    if (Math.abs(line.bend(d, 0.7)) > 0.22 || d - last < 2.6 || posts.some((post) => Math.abs(post - d) < 1)) continue;
    const side = k % 2, wide = line.width(d), away = 0.62, [x, y] = line.place(d, side ? 1 + away / wide : -away / wide);
    if (![-0.6, 0, 0.6].every((along) => {
      const p = line.place(d + along, side ? 1 + away / wide : -away / wide);
      return free(line, p[0], p[1], 0.42);
    })) continue;
    const n = k % BOARDS.length;
    pictures.push({ x, y, z: GRASS_Z, yaw: line.heading(d, 0.6), wide: 1.3, high: 0.2, cell: cell(512 * (n % 2), 80 * Math.floor(n / 2), 512, 80) });
    last = d; k += 1;
  }
}

function addTurns(solid, pictures, line, turns) {
  for (const turn of turns.slice(0, 30)) {
    const metres = turn.from_m ?? 0, wide = line.width(metres), side = line.bend(turn.apex_m ?? metres, 0.3) > 0 ? 1 : 0, away = 0.42;
    const [x, y] = line.place(metres, side ? 1 + away / wide : -away / wide), yaw = line.heading(metres);
    if (!free(line, x, y, 0.25)) continue;
    solid.add(new THREE.BoxGeometry(0.018, 0.018, 0.24), at(x, y, 0.11, yaw), new THREE.Color("#6b727b"), LIGHT);
    const k = turn.number - 1;
    pictures.push({ x: x - 0.02 * Math.cos(yaw), y: y - 0.02 * Math.sin(yaw), z: 0.2, yaw: yaw - Math.PI / 2, wide: 0.13, high: 0.13, cell: cell(102 * (k % 10), 262 + 64 * Math.floor(k / 10), 62, 62) });
  }
}

// A stand with its crowd along the straightest free place near the finish line.
function addStand(solid, pictures, shade, line) {
  for (const along of [0, 1.4, -1.4, 2.8, -2.8, 4.2, -4.2, 6, 8, 10]) {
    const d = line.lines.at(-1) + along;
    if (Math.abs(line.bend(d, 1)) > 0.15) continue;
    for (const side of [1, 0]) {
      const wide = line.width(d), yaw = line.heading(d, 0.8), out = side ? yaw - Math.PI / 2 : yaw + Math.PI / 2, far = [0.95, 1.9];
      const spot = (along, away) => {
        const [x, y] = line.place(d, side ? 1 + away / wide : -away / wide);
        return [x + Math.cos(yaw) * along, y + Math.sin(yaw) * along];
      };
      if (![-1.5, 0, 1.5].every((along) => far.every((away) => free(line, ...spot(along, away), 0.5)))) continue;
      const grey = new THREE.Color("#8c939c");
      for (let row = 0; row < 4; row += 1) {
        const away = 1 + 0.22 * row, [x, y] = spot(0, away), z = 0.12 + 0.13 * row;
        solid.add(new THREE.BoxGeometry(0.22, 3, z), at(x, y, z / 2, out), grey, LIGHT);
        const face = spot(0, away - 0.02);
        pictures.push({ x: face[0], y: face[1], z, yaw: side ? yaw + Math.PI : yaw, wide: 2.96, high: 0.13, cell: cell(150 * row, 458, 560, 34) });
      }
      const [bx, by] = spot(0, 1.95), [rx, ry] = spot(0, 1.45), dark = new THREE.Color("#2c323a");
      solid.add(new THREE.BoxGeometry(0.05, 3.1, 1.1), at(bx, by, 0.55, out), dark, LIGHT);
      solid.add(new THREE.BoxGeometry(1.15, 3.2, 0.04), at(rx, ry, 1.12, out), new THREE.Color("#d4d9df"), LIGHT);
      shade.push([...spot(0, 1.45), 3.4]);
      return;
    }
  }
}

function shadowsMesh(shade, look) {
  const soft = new Triangles(), white = new THREE.Color("#000");
  for (const [x, y, size] of shade) {
    const r = size / 2, ids = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) =>
      soft.corner(x + 0.12 * size + i * r, y + 0.12 * size + j * r, GRASS_Z + 0.006, white, 1, (i + 1) / 2, (j + 1) / 2));
    soft.index.push(ids[0], ids[1], ids[2], ids[0], ids[2], ids[3]);
  }
  const blob = canvasTexture(64, 64, (pen) => {
    const dark = pen.createRadialGradient(32, 32, 2, 32, 32, 32);
    dark.addColorStop(0, `rgba(0,0,0,${look.shade})`); dark.addColorStop(1, "rgba(0,0,0,0)");
    pen.fillStyle = dark; pen.fillRect(0, 0, 64, 64);
  });
  return soft.mesh(new THREE.MeshBasicMaterial({ map: blob, transparent: true, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -8 }));
}

export function tracksideOf(line, scene, look) {
  const solid = new Triangles(), pictures = [], shade = [], next = numbers(scene.name);
  addHills(solid, line, look);
  addTrees(solid, shade, line, look, next);
  addTyres(solid, shade, line, look);
  addArch(solid, pictures, line, look);
  addStand(solid, pictures, shade, line);
  addBoards(pictures, shade, line);
  addTurns(solid, pictures, line, scene.turns ?? []);
  const dim = (mesh) => { mesh.material.color.setScalar(look.bright); return mesh; };
  const meshes = [
    Object.assign(dim(solid.mesh(new THREE.MeshBasicMaterial({ vertexColors: true }))), { renderOrder: 3 }),
    Object.assign(dim(picturesMesh(pictures, atlas(scene.name, look))), { renderOrder: 3 }),
    Object.assign(shadowsMesh(shade, look), { renderOrder: 6 }),
  ];
  for (const mesh of meshes) mesh.frustumCulled = false;
  return meshes;
}
