// The replay from above as SVG: over a map that the server has drawn into `root`, else over one of its own.
import { JUMP_M, NOSE_M } from "./store.js";

const SVG = "http://www.w3.org/2000/svg";
const MARGIN_M = 0.3; // of the server's map (tracks/drawing.py)
const TAIL_MS = 1500;
const CAR = 0.025; // half a car's length, of the map's longer side
const BOT = "M1.15 0 -.75 .75 -.35 0 -.75 -.75Z";

function element(name, attributes, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

const path = (points, close) => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(3)} ${y.toFixed(3)}`).join("") + (close ? "Z" : "");

// The driven line of a car between its start and end, broken where it was reset.
function driven({ columns: { t, x, y }, start, duration }) {
  let line = "";
  let before = -1;
  for (let i = 0; i < t.length; i += 1) {
    if (t[i] < start || t[i] > start + duration) continue;
    const joins = before >= 0 && Math.hypot(x[i] - x[before], y[i] - y[before]) <= JUMP_M;
    line += `${joins ? "L" : "M"}${x[i].toFixed(3)} ${y[i].toFixed(3)}`;
    before = i;
  }
  return line;
}

function road({ inner, outer, centre, closed, start }) {
  const area = closed ? path(outer, true) + path(inner, true) : path([...outer, ...[...inner].reverse()], true);
  const across = ((start.yaw + 90) * Math.PI) / 180;
  const half = (start.width ?? 0.6) / 2;
  const [dx, dy] = [half * Math.cos(across), half * Math.sin(across)];
  return [
    element("path", { class: "track-road", "fill-rule": "evenodd", d: area }),
    element("path", { class: "track-centre", d: path(centre, closed) }),
    element("path", { class: "track-finish", d: `M${start.x - dx} ${start.y - dy}L${start.x + dx} ${start.y + dy}` }),
  ];
}

export function createFlatMap(root, replay) {
  const { scene } = replay;
  const [left, low, right, high] = scene.bounds;
  const [width, height] = [right - left + 2 * MARGIN_M, high - low + 2 * MARGIN_M];
  const drawn = root.querySelector(".track-map"); // the server's, with the lines of its laps
  const size = CAR * Math.max(width, height);
  const world = element("g", { transform: `translate(${MARGIN_M - left} ${high + MARGIN_M}) scale(1 -1)` });
  const tail = element("polyline", { class: "replay-tail", points: "" });
  if (!drawn) {
    world.append(element("g", { class: "flat-road" }, ...road(scene)));
    for (const run of replay.runs) world.append(element("path", { class: "flat-line", stroke: run.look.colour, d: driven(run) }));
    for (const box of replay.boxes) {
      const half = [-box.length / 2, -box.width / 2];
      world.append(element("g", { class: "track-box", transform: `translate(${box.x} ${box.y}) rotate(${box.yaw})` },
        element("path", { d: `M${half[0]} ${half[1]}H${-half[0]}V${-half[1]}H${half[0]}Z` })));
    }
  }
  const bots = replay.bots.map(() => element("g", { class: "replay-bot" }, element("path", { d: BOT })));
  const cars = replay.runs.map((run, number) => {
    const shape = element("g", { class: `replay-car${run.ghost ? " ghost" : ""}`, "data-car": number });
    shape.innerHTML = run.look.above; // the site's own drawing
    shape.querySelector(".above-body")?.setAttribute("fill", run.look.colour);
    return shape;
  });
  world.append(tail, ...bots, ...[...cars].reverse());
  const overlay = element("svg", {
    class: drawn ? "overlay" : "flat-map", viewBox: `0 0 ${width.toFixed(2)} ${height.toFixed(2)}`, "aria-hidden": "true",
  }, world);
  root.append(overlay);

  const put = (shape, { x, y, yaw }, back) => shape.setAttribute("transform",
    `translate(${x.toFixed(4)} ${y.toFixed(4)}) rotate(${yaw.toFixed(2)})${back ? ` translate(${-NOSE_M} 0)` : ""} scale(${size} ${-size})`);

  return {
    draw(_replay, ms) {
      replay.bots.forEach((bot, at) => put(bots[at], bot.at(ms), false));
      replay.runs.forEach((run, at) => {
        const pose = run.at(ms);
        put(cars[at], pose, true);
        cars[at].classList.toggle("standing", pose.standing);
        cars[at].classList.toggle("gone", pose.done);
        if (at) return;
        const { t, x, y } = run.columns;
        const points = [`${pose.x},${pose.y}`];
        for (let k = pose.i; k >= 0 && ms + run.start - t[k] < TAIL_MS; k -= 1) {
          if (k < pose.i && Math.hypot(x[k] - x[k + 1], y[k] - y[k + 1]) > JUMP_M) break;
          points.push(`${x[k]},${y[k]}`);
        }
        tail.setAttribute("points", points.join(" "));
      });
    },
    setCamera() {},
    resize() {},
    dispose() { overlay.remove(); },
  };
}
