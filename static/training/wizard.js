// The training wizard: draws the action space while the racer types or drags, fills the action table, and colours the
// shells; the form works without it.
"use strict";

(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const RADIUS = 100;
  const TOP_SPEED = 4;
  const TURN = 2.4; // the fan opens wider than the wheels turn, so that neighbours can be told apart
  const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
  const round = (value, digits) => Number(value.toFixed(digits));

  function shape(tag, attributes, parent) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (parent) parent.append(made);
    return made;
  }

  // where an action's ray ends: straight on is up, steering to the left is to the left
  function place(angle, speed) {
    const turn = (clamp(angle, -30, 30) * TURN * Math.PI) / 180;
    const length = (RADIUS * clamp(speed, 0, TOP_SPEED)) / TOP_SPEED;
    return [round(-length * Math.sin(turn), 2), round(-length * Math.cos(turn), 2)];
  }

  function sector(lowAngle, highAngle, slow, fast) {
    const [outer, inner] = [(RADIUS * fast) / TOP_SPEED, (RADIUS * slow) / TOP_SPEED];
    const [a, b, c, d] = [place(highAngle, fast), place(lowAngle, fast), place(lowAngle, slow), place(highAngle, slow)];
    return `M${a}A${outer},${outer} 0 0 1 ${b}L${c}A${inner},${inner} 0 0 0 ${d}Z`;
  }

  function frame(holder) {
    const svg = shape("svg", { class: "fan big-fan", viewBox: "-104 -112 208 126", role: "img" });
    shape("title", {}, svg).textContent = holder.dataset.title;
    for (const speed of [1, 2, 3, 4]) {
      shape("path", { class: "fan-rim", d: sector(-30, 30, 0, speed) }, svg);
      const [x, y] = place(-30, speed);
      shape("text", { class: "fan-word", x: x + 3, y: y + 6 }, svg).textContent = speed;
    }
    for (const angle of [-30, 0, 30]) {
      const [x, y] = place(angle, 4.25);
      shape("text", { class: "fan-word", x, y, "text-anchor": "middle" }, svg).textContent = `${angle}°`;
    }
    const inside = shape("g", {}, svg);
    holder.replaceChildren(svg);
    return { svg, inside };
  }

  const number = (form, name) => Number(form.elements[name] ? form.elements[name].value : NaN);

  function discrete(form, holder) {
    const { inside } = frame(holder);
    const rows = [...form.querySelectorAll("[data-action-row]")];
    const fields = (row) => row.querySelectorAll("input");
    const used = () => rows.filter((row) => fields(row)[0].value !== "");
    const draw = () => {
      inside.replaceChildren();
      for (const row of used()) {
        const [angle, speed] = [...fields(row)].map((field) => Number(field.value));
        const [x, y] = place(angle, speed);
        shape("line", { class: "fan-ray", x1: 0, y1: 0, x2: x, y2: y }, inside);
        shape("circle", { class: "fan-tip", cx: x, cy: y, r: 3 }, inside);
      }
      const count = used().length;
      rows.forEach((row, index) => { row.hidden = index > count; });
    };
    const make = () => {
      const [steering, angles, speed, speeds] =
        ["steering_max", "steering_granularity", "speed_max", "speed_granularity"].map((name) => number(form, name));
      if (!(steering > 0 && angles > 1 && speed > 0 && speeds > 0)) return;
      const actions = [];
      for (let i = 0; i < angles; i += 1) {
        for (let k = 1; k <= speeds; k += 1) {
          actions.push([round(-steering + (2 * steering * i) / (angles - 1), 2) + 0, Math.max(0.1, round((speed * k) / speeds, 2))]);
        }
      }
      rows.forEach((row, index) => fields(row).forEach((field, which) => {
        field.value = index < actions.length ? actions[index][which] : "";
      }));
      draw();
    };
    form.addEventListener("input", (event) => {
      if (/_(max|granularity)$/.test(event.target.name)) make();
      else if (event.target.closest("[data-action-row]")) draw();
    });
    form.querySelector("[data-make-table]").addEventListener("click", (event) => { event.preventDefault(); make(); });
    draw();
  }

  function continuous(form, holder) {
    const { svg, inside } = frame(holder);
    const names = ["steering_low", "steering_high", "speed_low", "speed_high"];
    const area = shape("path", { class: "fan-area", d: "" }, inside);
    const corners = [["steering_low", "speed_high"], ["steering_high", "speed_high"], ["steering_low", "speed_low"], ["steering_high", "speed_low"]];
    const handles = corners.map(() => {
      const handle = shape("g", { class: "fan-handle", tabindex: 0, role: "button" }, inside);
      shape("circle", { class: "fan-reach", r: 11 }, handle); // a finger is no needle
      shape("circle", { class: "fan-knob", r: 5 }, handle);
      return handle;
    });
    const labels = Object.fromEntries(names.map((name) => [name, form.elements[name].labels[0].textContent.trim()]));
    const draw = () => {
      const [low, high, slow, fast] = names.map((name) => number(form, name));
      if (![low, high, slow, fast].every(Number.isFinite)) return;
      area.setAttribute("d", sector(low, high, slow, fast));
      corners.forEach(([angle, speed], index) => {
        const [x, y] = place(number(form, angle), number(form, speed));
        handles[index].setAttribute("transform", `translate(${x} ${y})`);
        handles[index].setAttribute("aria-label", [angle, speed].map((name) => `${labels[name]}: ${number(form, name)}`).join(", "));
      });
    };
    const point = (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      return [(Math.atan2(-at.x, -at.y) * 180) / Math.PI / TURN, (Math.hypot(at.x, at.y) * TOP_SPEED) / RADIUS];
    };
    const put = (name, value, low, high, digits) => { form.elements[name].value = round(clamp(value, low, high), digits); };
    const move = ([angleName, speedName], angle, speed) => {
      const [left, right] = [number(form, "steering_high"), number(form, "steering_low")];
      const [slow, fast] = [number(form, "speed_low"), number(form, "speed_high")];
      put(angleName, angle, angleName === "steering_low" ? -30 : right + 1, angleName === "steering_low" ? left - 1 : 30, 0);
      put(speedName, speed, speedName === "speed_low" ? 0.1 : slow + 0.1, speedName === "speed_low" ? fast - 0.1 : 4, 1);
      draw();
    };
    const KEYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    handles.forEach((handle, index) => {
      const [angleName, speedName] = corners[index];
      handle.addEventListener("keydown", (event) => {
        const step = KEYS[event.key];
        if (!step) return;
        event.preventDefault();
        move(corners[index], number(form, angleName) + step[0], number(form, speedName) + step[1]);
      });
      handle.addEventListener("pointerdown", (event) => { handle.setPointerCapture(event.pointerId); handle.focus(); event.preventDefault(); });
      handle.addEventListener("pointermove", (event) => {
        if (!handle.hasPointerCapture(event.pointerId)) return;
        move(corners[index], ...point(event));
      });
    });
    form.addEventListener("input", (event) => { if (names.includes(event.target.name)) draw(); });
    form.querySelectorAll("[data-reset]").forEach((button) => button.addEventListener("click", (event) => {
      event.preventDefault();
      button.dataset.reset.split(" ").forEach((value, index) => { form.elements[names[index]].value = value; });
      draw();
    }));
    const hint = form.querySelector("[data-drag-hint]");
    if (hint) hint.hidden = false;
    draw();
  }

  document.querySelectorAll("[data-fan]").forEach((holder) => {
    (holder.dataset.fan === "discrete" ? discrete : continuous)(holder.closest("form"), holder);
  });

  // --- what nobody has changed follows the algorithm -------------------------------------------------------------------
  document.querySelectorAll("form:has([data-ppo][data-sac])").forEach((form) => {
    form.addEventListener("change", (event) => {
      if (event.target.name !== "algorithm") return;
      const chosen = event.target.value;
      form.elements.usual_of.value = chosen;
      const before = chosen === "sac" ? "ppo" : "sac";
      form.querySelectorAll("[data-ppo][data-sac]").forEach((field) => {
        if (field.value === field.dataset[before]) field.value = field.dataset[chosen];
      });
    });
  });

  // --- SAC needs ranges: choosing it selects them, and going back to PPO brings back the table that it replaced ---------------
  document.querySelectorAll("form:has([name='algorithm']):has([name='action_space_type'])").forEach((form) => {
    const radio = (value) => form.querySelector(`[name='action_space_type'][value='${value}']`);
    const [table, ranges] = [radio("discrete"), radio("continuous")];
    let replaced = false;
    const choose = (one) => { one.checked = true; one.dispatchEvent(new Event("change", { bubbles: true })); };
    const follow = () => {
      const needsRanges = form.elements.algorithm.value === "sac";
      if (needsRanges && table.checked) { replaced = true; choose(ranges); }
      else if (!needsRanges && replaced) { replaced = false; choose(table); }
      table.disabled = needsRanges;
    };
    form.addEventListener("change", (event) => { if (event.target.name === "algorithm") follow(); });
    addEventListener("pageshow", follow);
    follow();
  });

  // --- all hyperparameters at once: a button has the values of each algorithm ------------------------------------------
  document.querySelectorAll("[data-fill]").forEach((button) => button.addEventListener("click", (event) => {
    event.preventDefault();
    const { elements } = button.form;
    Object.entries(JSON.parse(button.dataset.fill)[elements.algorithm.value] ?? {}).forEach(([name, value]) => {
      elements[name].value = value;
    });
  }));

  // --- races like the training come first --------------------------------------------------------------------------------
  document.querySelectorAll("select:has(option[data-drives])").forEach((list) => {
    const form = list.closest("form");
    const value = (name) => new FormData(form).get(name);
    const order = [...list.options]; // the league's first, then those that close first
    const unlike = (option) => {
      if (!option.dataset.drives) return -1;
      const [track, type, direction] = option.dataset.drives.split(" ");
      const [here, same] = [track === value("track"), type === value("race_type")];
      return here && same ? Number(direction !== value("direction")) : 4 - 2 * here - same;
    };
    form.addEventListener("change", (event) => {
      if (!["track", "direction", "race_type"].includes(event.target.name)) return;
      const chosen = list.value;
      list.append(...[...order].sort((one, other) => unlike(one) - unlike(other)));
      list.value = chosen;
    });
  });

  // --- the step that is on screen --------------------------------------------------------------------------------------
  const links = [...document.querySelectorAll(".wizard-steps a")];
  if (links.length && "IntersectionObserver" in window) {
    const seen = new Map();
    const watcher = new IntersectionObserver((entries) => {
      entries.forEach((entry) => seen.set(entry.target.id, entry.isIntersecting));
      const now = links.find((link) => seen.get(link.hash.slice(1)));
      links.forEach((link) => {
        if (link === now) link.setAttribute("aria-current", "step");
        else link.removeAttribute("aria-current");
      });
    }, { rootMargin: "-20% 0px -60% 0px" });
    links.forEach((link) => { const part = document.querySelector(link.hash); if (part) watcher.observe(part); });
  }

  // --- shells wear the colour that is chosen ---------------------------------------------------------------------------
  document.querySelectorAll("[data-shells]").forEach((list) => {
    const colour = list.closest("form").elements.colour;
    colour.addEventListener("input", () => list.querySelectorAll(".shell-body").forEach((body) => {
      body.setAttribute("fill", colour.value);
    }));
  });
})();
