// The newest evaluation of a training in three dimensions, above its map: graph.js says where on its drive the car is.
import { hasWebGL } from "../viewer/webgl.js";
import { Run, turn } from "../viewer/store.js";

const STEP_MS = 1000 / 15;
const MARGIN_M = 0.3; // of the map (tracks/drawing.py)
const WHEELBASE_M = 0.164;

// A run document's columns from the rows of the map: x, y, heading in radians clockwise, speed.
function columnsOf(drive, [left, , , top]) {
  const [x, y] = [drive.map((row) => row[0] + left - MARGIN_M), drive.map((row) => top + MARGIN_M - row[1])];
  const yaw = drive.map((row) => (-row[2] * 180) / Math.PI), all = (value) => drive.map(() => value);
  const steer = yaw.map((angle, i) => {
    const next = Math.min(i + 1, yaw.length - 1), far = Math.hypot(x[next] - x[i], y[next] - y[i]);
    return far < 0.02 || far > 0.6 ? 0 : (Math.atan((WHEELBASE_M * turn(angle, yaw[next]) * Math.PI) / 180 / far) * 180) / Math.PI;
  });
  return { t: drive.map((_, i) => i * STEP_MS), x, y, yaw, v: drive.map((row) => row[3]), steer, lap: all(1), status: all("in_progress"), progress: all(0), on_track: all(true) };
}

async function begin(canvas) {
  const { scene: address, look, boxes, name } = JSON.parse(canvas.dataset.driveScene);
  const [answer, { createScene }] = await Promise.all([fetch(address), import("../viewer/scene.js")]);
  if (!answer.ok) return;
  const scene = await answer.json(), replay = { scene, runs: [], boxes, bots: [] };
  let driven = null, inSight = true; // it is shown from the first drive on
  const view = createScene(canvas, replay, { onLost: () => { canvas.hidden = true; }, onRestored: () => { canvas.hidden = !driven; } });
  new IntersectionObserver(([entry]) => { inSight = entry.isIntersecting; }).observe(canvas);
  new ResizeObserver(() => view.resize()).observe(canvas);
  document.addEventListener("training:drive", ({ detail: { drive, ms } }) => {
    if (drive.length < 2 || (driven && !inSight) || document.hidden) return;
    if (!driven) canvas.hidden = false;
    if (drive !== driven) replay.runs = [new Run({ columns: columnsOf((driven = drive), scene.bounds), laps: [], name, look })];
    view.draw(replay, Math.min(ms, replay.runs[0].duration));
  });
}

const canvas = document.querySelector("[data-drive-scene]");
if (canvas && hasWebGL() && !navigator.connection?.saveData) begin(canvas).catch(() => { canvas.hidden = true; });
