// A training's page: shows the graph's values under the cursor and the car of the newest evaluation, and keeps open and
// selected parts when htmx replaces the graph.
"use strict";

(() => {
  // --- values under the cursor ---------------------------------------------------------------------------------------
  let pointed = null; // share of the graph's width
  const number = (value, digits) => (value === null ? "–" : value.toFixed(digits));

  function show(box) {
    const svg = box.querySelector("svg");
    const tip = box.querySelector("[data-tip]");
    svg.querySelector(".graph-cursor")?.remove();
    if (pointed === null) { tip.hidden = true; return; }
    const points = JSON.parse(svg.dataset.points);
    const { width, height } = svg.viewBox.baseVal;
    const x = pointed * width;
    const near = points.reduce((best, each) => (Math.abs(each[0] - x) < Math.abs(best[0] - x) ? each : best), points[0]);
    const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
    for (const [name, value] of Object.entries({ class: "graph-cursor", x1: near[0], x2: near[0], y1: 14, y2: height - 34 })) line.setAttribute(name, value);
    svg.append(line);
    const words = box.dataset;
    const head = document.createElement("b");
    head.textContent = `${words.iteration} ${near[1]}`;
    const rows = [`${near[2]} ${words.steps}`, `${words.reward} ${number(near[3], 1)}`, `${words.progress} ${number(near[4], 0)} %`, `${words.evaluation} ${number(near[5], 0)} %`];
    if (near[6] !== null) rows.push(`${words.lap} ${number(near[6], 3)} s`);
    tip.replaceChildren(head, ...rows.flatMap((text) => [document.createTextNode(text), document.createElement("br")]));
    tip.hidden = false;
    const left = (near[0] / width) * box.clientWidth;
    tip.style.left = `${Math.max(0, left > box.clientWidth / 2 ? left - tip.offsetWidth - 12 : left + 12)}px`;
  }

  document.addEventListener("pointermove", (event) => {
    const box = event.target.closest?.("[data-graph]");
    const before = pointed;
    if (box) {
      const area = box.querySelector("svg").getBoundingClientRect();
      pointed = (event.clientX - area.left) / area.width;
    } else pointed = null;
    if (pointed !== before) document.querySelectorAll("[data-graph]").forEach(show);
  });

  // --- the car -------------------------------------------------------------------------------------------------------
  const STEP_MS = 1000 / 15;
  const TAIL = 20;
  const JUMP_M = 0.6;
  const stage = document.querySelector("[data-drive-stage]");
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  let drive = [];
  let began = 0;

  function take() {
    const source = document.querySelector("[data-drive]");
    if (!source) return;
    const newest = source.dataset.drive;
    if (newest === take.seen) return;
    take.seen = newest;
    drive = JSON.parse(newest);
    began = performance.now();
    document.querySelectorAll("[data-drive-none]").forEach((each) => { each.hidden = drive.length > 0; });
    document.querySelectorAll("[data-drive-some]").forEach((each) => { each.hidden = !drive.length; });
  }

  function frame(now) {
    requestAnimationFrame(frame);
    if (!drive.length) return;
    const car = stage.querySelector("[data-drive-car]");
    const all = still.matches ? drive.length - 1 : (Math.max(0, now - began) / STEP_MS) % (drive.length + 12);
    const index = Math.min(drive.length - 1, Math.floor(all));
    const next = Math.min(drive.length - 1, index + 1);
    const share = Math.min(1, all - index) * (next > index);
    let [x, y, yaw, speed] = drive[index];
    if (share && Math.hypot(drive[next][0] - x, drive[next][1] - y) < JUMP_M) {
      x += share * (drive[next][0] - x);
      y += share * (drive[next][1] - y);
    }
    document.dispatchEvent(new CustomEvent("training:drive", { detail: { drive, ms: all * STEP_MS } }));
    const box = stage.viewBox.baseVal;
    const size = 0.022 * Math.max(box.width, box.height);
    car.removeAttribute("hidden");
    car.setAttribute("transform", `translate(${x} ${y}) rotate(${(yaw * 180) / Math.PI}) scale(${size})`);
    const tail = [[x, y]];
    for (let back = index; back > Math.max(0, index - TAIL); back -= 1) {
      if (back < index && Math.hypot(drive[back][0] - drive[back + 1][0], drive[back][1] - drive[back + 1][1]) > JUMP_M) break;
      tail.push(drive[back]);
    }
    stage.querySelector("[data-drive-tail]").setAttribute("points", tail.map((point) => `${point[0]},${point[1]}`).join(" "));
    const text = `${speed.toFixed(1)} m/s`;
    const out = document.querySelector("[data-drive-speed]");
    if (out && out.textContent !== text) out.textContent = text;
  }

  // --- a new graph came ------------------------------------------------------------------------------------------------
  const open = new Set();
  document.addEventListener("toggle", (event) => {
    const name = event.target.dataset?.keep;
    if (name) open[event.target.open ? "add" : "delete"](name);
  }, true);
  document.addEventListener("htmx:beforeSwap", () => {
    document.querySelectorAll("details[data-keep]").forEach((part) => open[part.open ? "add" : "delete"](part.dataset.keep));
  });
  document.addEventListener("htmx:afterSettle", () => {
    document.querySelectorAll("details[data-keep]").forEach((part) => { part.open = open.has(part.dataset.keep); });
    document.querySelectorAll(".log").forEach((log) => { log.scrollTop = log.scrollHeight; });
    document.querySelectorAll("[data-graph]").forEach(show);
    take();
  });

  document.querySelectorAll(".log").forEach((log) => { log.scrollTop = log.scrollHeight; });
  if (stage) { take(); requestAnimationFrame(frame); }
})();
