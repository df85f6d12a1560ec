// The replay from above as SVG: over a map that the server has drawn into `root`, else over one of its own.
import { JUMP_M, NOSE_M } from "./store.js";

const SVG = "http://www.w3.org/2000/svg";
const MARGIN_M = 0.3; // of the server's map (tracks/drawing.py)
const TAIL_MS = 1500;
const CAR = 0.06; // a car with its margin, of the map's longer side
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

// A car, ghost or bot: its own layer, moved by its transform alone.
function mover(root, { kind, look, number }) {
  const shape = element("svg", { class: `mover ${kind}`, viewBox: "-1.2 -1.2 2.4 2.4", "aria-hidden": "true", ...(look && { "data-car": number }) });
  if (look) {
    shape.innerHTML = look.above; // the site's own drawing
    shape.querySelector(".above-body")?.setAttribute("fill", look.colour);
  } else shape.append(element("path", { d: BOT }));
  root.append(shape);
  return shape;
}

export function createFlatMap(root, replay) {
  const { scene } = replay;
  const [left, low, right, high] = scene.bounds;
  const [width, height] = [right - left + 2 * MARGIN_M, high - low + 2 * MARGIN_M];
  const drawn = root.querySelector(".track-map"); // the server's, with the lines of its laps
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
  world.append(tail);
  const overlay = element("svg", {
    class: drawn ? "overlay" : "flat-map", viewBox: `0 0 ${width.toFixed(2)} ${height.toFixed(2)}`, "aria-hidden": "true",
  }, world);
  root.append(overlay);
  let [runs, cars, bots, place] = [[], [], [], null];

  function fill(now) {
    for (const { shape } of [...cars, ...bots]) shape.remove();
    runs = [...now.runs];
    bots = now.bots.map((bot) => ({ bot, shape: mover(root, { kind: "replay-bot" }) }));
    cars = runs.map((run, number) => ({ run, shape: mover(root, { kind: `replay-car${run.ghost ? " ghost" : ""}`, look: run.look, number }) }));
    for (const { shape } of [...cars].reverse()) root.append(shape); // the first on top
    tail.setAttribute("points", "");
    tail.step = null;
  }

  // Where the world's origin is in pixels: asked for when the map's size changes, and never while cars are drawn.
  function resize() {
    const [matrix, box] = [world.getScreenCTM(), root.getBoundingClientRect()];
    if (!matrix?.a || !box.width) { place = null; return; }
    place = { scale: matrix.a, x: matrix.e - box.left, y: matrix.f - box.top };
    root.style.setProperty("--mover", `${(CAR * Math.max(width, height) * matrix.a).toFixed(1)}px`);
  }

  function put(shape, { x, y, yaw }, back) {
    shape.style.transform = `translate(${(place.x + place.scale * x).toFixed(2)}px,${(place.y - place.scale * y).toFixed(2)}px) rotate(${(-yaw).toFixed(2)}deg)`
      + (back ? ` translate(${(-NOSE_M * place.scale).toFixed(2)}px,0)` : "");
  }

  const mark = (shape, name, is) => { if (shape.classList.contains(name) !== is) shape.classList.toggle(name, is); };

  return {
    draw(now, ms) {
      if (runs.length !== now.runs.length || bots.length !== now.bots.length || runs.some((run, at) => run !== now.runs[at])) fill(now);
      if (!place) resize();
      if (!place) return;
      for (const { bot, shape } of bots) put(shape, bot.at(ms), false);
      cars.forEach(({ run, shape }, at) => {
        const pose = run.at(ms);
        put(shape, pose, true);
        mark(shape, "standing", pose.standing);
        mark(shape, "gone", pose.done);
        if (at || tail.step === pose.i) return;
        tail.step = pose.i;
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
    resize,
    dispose() { for (const shape of [overlay, ...[...cars, ...bots].map((each) => each.shape)]) shape.remove(); },
  };
}
