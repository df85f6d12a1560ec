// The timekeeper's page: measures laps by the monotonic clock, stores them in the browser, and sends each session as a
// whole with an id and a revision, so that repeated sending changes nothing.
"use strict";

(async () => {
  const root = document.querySelector("[data-timing]");
  const data = JSON.parse(document.getElementById("timing-data").textContent);
  const { words } = data;
  const part = (name) => root.querySelector(`[data-part="${name}"]`);
  const buttons = Object.fromEntries([...root.querySelectorAll("[data-do]")].map((each) => [each.dataset.do, each]));
  const said = (key, value) => words[key].replace("%s", value);
  const EPOCH = TimingStore.id();  // of this load of the page: performance.now() begins anew with each
  const UNDO = 100, SEND_AFTER_MS = 400, SEND_AGAIN_MS = 15000, ASK_SENSOR_MS = 1000, ANSWER_MS = 15000, CLOCKS_DIFFER_MS = 1000;
  const moment = () => ({ mono: performance.now(), wall: Date.now(), epoch: EPOCH });

  function written(milliseconds) {
    const whole = Math.max(0, Math.floor(milliseconds));
    const two = (value, digits) => String(value).padStart(digits, "0");
    return `${Math.floor(whole / 60000)}:${two(Math.floor(whole / 1000) % 60, 2)}.${two(whole % 1000, 3)}`;
  }

  // --- one tab at a time takes times ----------------------------------------------------------------------------------
  async function alone() {
    if (!navigator.locks) return true;  // only where the page is not served securely
    return new Promise((resolve) => {
      navigator.locks.request(`timing-${data.slug}`, { ifAvailable: true }, (lock) => {
        resolve(Boolean(lock));
        return lock && new Promise(() => {});  // held as long as the page lives
      });
    });
  }
  if (!await alone()) { part("blocked").textContent = words.elsewhere; part("blocked").hidden = false; return; }

  let store;
  try {
    store = await TimingStore.open(data.slug);
  } catch {
    part("blocked").textContent = words.notKept;
    part("blocked").hidden = false;
    return;
  }

  let sessions = (await store.all("sessions")).sort((a, b) => a.started.wall - b.started.wall);
  let guests = [];
  let session = sessions.find((each) => !each.ended && !each.discarded) || null;
  let notice = session?.running ? words.reloaded : "";
  let trouble = "";
  let wentOver = false;

  // --- keeping and sending --------------------------------------------------------------------------------------------
  let sending = false, timer = 0, keeping = 0;
  const unsent = () => sessions.filter((each) => each.revision > each.sent && !each.refused);
  const refused = () => sessions.filter((each) => each.refused);

  async function keep(changed) {
    changed.revision += 1;
    changed.refused = null;
    draw();  // at once: a key pressed while the browser is still writing counts
    root.dataset.keeping = ++keeping;
    await store.put("sessions", changed).catch(() => { trouble = words.notKept; });
    if (!--keeping) delete root.dataset.keeping;
    clearTimeout(timer);
    timer = setTimeout(send, SEND_AFTER_MS);
  }

  const cookie = (name) => document.cookie.split("; ").find((each) => each.startsWith(`${name}=`))?.slice(name.length + 1) || "";

  function told(each) {
    const now = moment();
    return {
      id: each.id, revision: each.revision, racer: each.racer, guest: each.guest, car: each.car, sensor: each.sensor,
      started_at: new Date(now.wall - passed(each.started, now)).toISOString(), ended: each.ended, discarded: each.discarded,
      laps: each.laps.map(({ id, number, time_ms, wall_ms, off_tracks, resets, valid, note }) =>
        ({ id, number, time_ms, wall_ms, off_tracks, resets, valid, note })),
    };
  }

  async function send() {
    const waiting = unsent().slice(0, 50);
    if (sending || !waiting.length) return;
    sending = true;
    try {
      const answer = await fetch(`${data.api}sessions/`, {
        method: "POST", credentials: "same-origin", signal: AbortSignal.timeout(ANSWER_MS),
        headers: { "Content-Type": "application/json", "X-CSRFToken": cookie(data.csrf) },
        body: JSON.stringify({ sent_at: new Date().toISOString(), sessions: waiting.map(told) }),
      });
      if (answer.ok) {
        trouble = "";
        for (const { id, revision, code, message } of (await answer.json()).results) {
          const each = sessions.find((one) => one.id === id);
          const sent = waiting.find((one) => one.id === id);
          if (code) { if (each.revision === told(sent).revision) each.refused = { code, message }; }
          else each.sent = Math.max(each.sent, revision);
          await store.put("sessions", each);
        }
      } else if (answer.status === 401 || answer.status === 403) {
        const body = await answer.json().catch(() => ({}));
        trouble = body.code === "timing_not_yours" ? body.message : words.loggedOut;
      } else {
        trouble = (await answer.json().catch(() => ({}))).message || `HTTP ${answer.status}`;
      }
    } catch {
      trouble = words.offline;
    }
    sending = false;
    draw();
    if (!trouble && unsent().length) timer = setTimeout(send, SEND_AFTER_MS);
  }

  // --- measuring ------------------------------------------------------------------------------------------------------
  const running = () => session && session.running;
  const same = (from) => from.epoch === EPOCH;
  const passed = (from, to) => Math.round(same(from) ? to.mono - from.mono : to.wall - from.wall);
  const snapshot = () => JSON.stringify({ laps: session.laps, running: session.running, ended: session.ended });
  function remember() { session.undo = [...session.undo.slice(1 - UNDO), snapshot()]; }

  // A clock that stands still or jumps is seen by holding the two of this device against each other.
  let before = moment();
  function watch() {
    const now = moment();
    const differ = Math.abs((now.wall - before.wall) - (now.mono - before.mono));
    before = now;
    if (differ > CLOCKS_DIFFER_MS && running() && same(session.running.from)) {
      session.running.note = "clock";
      notice = said("clock", Math.round(differ / 1000));
      store.put("sessions", session);
    }
  }

  function begin() {
    const name = part("guest").value.trim(), chosen = part("racer").value;
    if (session || !(name || chosen)) { notice = words.who; draw(); return; }
    const sensor = Number(part("sensor")?.value) || null;
    if (sensor && !navigator.onLine) { notice = words.needsNetwork; draw(); return; }
    const now = moment();
    session = {
      id: TimingStore.id(), revision: 0, sent: 0, refused: null, ...who(), car: part("car").value.trim(), sensor,
      started: now, ended: false, discarded: false, laps: [], undo: [],
      running: { from: now, off_tracks: 0, resets: 0, note: "" },
    };
    sessions.push(session);
    [notice, wentOver] = [sensor ? words.sensorIdle : "", false];
    return keep(session);
  }

  function who() {
    const name = part("guest").value.trim();
    if (!name) {
      const [kind, id] = part("racer").value.split(/:(.*)/s);
      return kind === "guest" ? { racer: "", guest: guests.find((each) => each.id === id) } : { racer: id, guest: null };
    }
    const known = guests.find((each) => each.name.toLowerCase() === name.toLowerCase());
    const guest = known || { id: TimingStore.id(), name };
    if (!known) { guests.push(guest); store.put("guests", guest); }
    part("guest").value = "";
    return { racer: "", guest: { id: guest.id, name: guest.name } };
  }

  function lap(valid) {
    if (!running() || session.sensor) return;
    watch();  // what has happened to the clocks until now belongs to this lap
    const to = moment(), from = session.running.from, time = passed(from, to), wall = to.wall - from.wall;
    if (valid && time < data.minimum_lap_ms) { notice = said("bounce", (time / 1000).toFixed(2)); draw(); return; }
    if (time < 1) return;
    remember();
    notice = session.running.note === "clock" ? notice : "";
    if (time > data.longest_lap_ms) {
      notice = said("tooLong", Math.round(data.longest_lap_ms / 60000));
      session.running = { from: to, off_tracks: 0, resets: 0, note: "" };
      return keep(session);
    }
    let note = session.running.note || (same(from) ? "" : "reloaded");
    const differ = Math.abs(wall - time);
    if (differ > CLOCKS_DIFFER_MS + time * 0.02) { note = "clock"; notice = said("clock", Math.round(differ / 1000)); }
    session.laps.push({
      id: TimingStore.id(), number: session.laps.length + 1, time_ms: time, wall_ms: wall, note,
      off_tracks: session.running.off_tracks, resets: session.running.resets, valid: valid && note !== "clock",
    });
    if (left(to) <= 0) { session.ended = true; session.running = null; }
    else session.running = { from: to, off_tracks: 0, resets: 0, note: "" };
    return settle();
  }

  function settle() {
    const changed = session;
    if (changed.ended || changed.discarded) session = null;
    return keep(changed);
  }

  function count(name) {
    if (!running()) return;
    remember();
    session.running[name] += 1;
    notice = "";
    return keep(session);
  }

  function undo() {
    const one = session || sessions.filter((each) => !each.discarded).at(-1);
    if (!one || !one.undo.length || (session && session !== one)) return;
    Object.assign(one, JSON.parse(one.undo.pop()));
    if (!one.ended) session = one;
    notice = "";
    return keep(one);
  }

  function end() {
    if (!session) return;
    remember();
    session.ended = true;
    session.running = null;
    return settle();
  }

  const left = (now) => (session ? data.session_ms - passed(session.started, now) : 0);

  // --- laps that a sensor measures: read from the site, with what was seen here kept ------------------------------------
  let asking = false; // a slow answer must not pile up requests
  async function askSensor() {
    if (asking || !session?.sensor || !session.sent) return;
    asking = true;
    const one = session;
    const found = await fetch(`${data.api}sessions/${one.id}/`, { credentials: "same-origin", signal: AbortSignal.timeout(ANSWER_MS) })
      .then((answer) => (answer.ok ? answer.json() : null)).catch(() => null);
    asking = false;
    if (!found) return;
    let changed = false;
    for (const each of found.laps.slice(one.laps.length)) {
      one.laps.push({
        id: each.id, number: each.number, time_ms: each.time_ms, wall_ms: null, note: "", valid: true,
        off_tracks: one.running?.off_tracks || 0, resets: one.running?.resets || 0,
      });
      if (one.running) Object.assign(one.running, { off_tracks: 0, resets: 0, from: moment() });
      changed = true;
    }
    if (found.ended_at && !one.ended) { one.ended = true; one.running = null; changed = true; if (session === one) session = null; }
    if (changed) await keep(one);
  }

  // --- what stands on the page ------------------------------------------------------------------------------------------
  const element = (name, text, ...classes) => {
    const made = document.createElement(name);
    made.textContent = text;
    made.classList.add(...classes);
    return made;
  };
  const button = (text, work, ...classes) => {
    const made = element("button", text, "button", "small", ...classes);
    made.type = "button";
    made.addEventListener("click", work);
    return made;
  };
  const nameOf = (each) => each.guest?.name || data.racers.find((one) => one.racer === each.racer)?.name || each.racer;

  function lapRow(each, one) {
    const row = document.createElement("tr");
    const counted = one.time_ms + one.off_tracks * data.penalty_ms;
    if (!one.valid) row.classList.add("invalid");
    row.append(element("th", String(one.number)), element("td", written(counted), "num"),
      element("td", String(one.off_tracks || "·"), "num"), element("td", String(one.resets || "·"), "num"));
    row.firstChild.scope = "row";
    const cell = element("td", "", "right");
    cell.append(button(one.valid ? words.valid : words.invalid, () => {
      if (each === session) remember();
      one.valid = !one.valid;
      keep(each);
    }, "quiet"));
    row.append(cell);
    return row;
  }

  function sessionRow(each) {
    const row = document.createElement("li");
    const best = Math.min(...each.laps.filter((one) => one.valid).map((one) => one.time_ms + one.off_tracks * data.penalty_ms));
    const state = each.discarded ? words.discarded : each.refused ? each.refused.message
      : each.revision > each.sent ? words.waiting : each.ended ? words.sent : words.running;
    row.dataset.session = each.id;
    row.append(element("strong", nameOf(each), "name"), element("span", said("laps", each.laps.length)),
      element("span", Number.isFinite(best) ? written(best) : "–", "num"),
      element("span", state, "state", each.refused ? "bad" : "soft"));
    if (each.refused) {
      row.querySelector(".state").dataset.code = each.refused.code;
      row.append(button(words.change, () => {
        if (!part("guest").value.trim() && !part("racer").value) { notice = words.who; draw(); return; }
        Object.assign(each, who());
        keep(each);
      }, "quiet"));
    }
    if (!each.discarded) row.append(button(words.discard, () => {
      if (!confirm(words.sure)) return;
      each.discarded = each.ended = true;
      each.running = null;
      if (session === each) session = null;
      keep(each);
    }, "quiet"));
    return row;
  }

  function options() {
    const select = part("racer"), chosen = select.value;
    const entries = [...data.racers.map((each) => [`racer:${each.racer}`, each.model ? `${each.name} · ${each.model}` : each.name]),
      ...guests.map((each) => [`guest:${each.id}`, `${each.name} *`])];
    if (select.options.length === entries.length + 1) return;
    select.replaceChildren(select.options[0], ...entries.map(([value, text]) => new Option(text, value)));
    select.value = chosen;
  }

  function draw() {
    options();
    const shown = session || sessions.filter((each) => !each.discarded).at(-1);
    for (const name of ["lap", "invalid"]) buttons[name].disabled = !running() || Boolean(session.sensor);
    for (const name of ["off", "reset"]) buttons[name].disabled = !running();
    buttons.start.disabled = Boolean(session);
    buttons.end.disabled = !session;
    buttons.undo.disabled = !shown?.undo.length;
    root.classList.toggle("is-running", Boolean(session));
    part("who").textContent = shown ? nameOf(shown) : "–";
    part("laps").replaceChildren(...(shown ? shown.laps.map((one) => lapRow(shown, one)).reverse() : []));
    part("sessions").replaceChildren(...[...sessions].reverse().slice(0, 40).map(sessionRow));
    part("notice").textContent = notice;
    const waiting = unsent().length;
    part("unsent").textContent = waiting ? said("unsent", waiting) : words.allSent;
    part("refused").textContent = refused().length ? said("refused", refused().length) : "";
    part("trouble").textContent = !navigator.onLine ? words.offline : trouble;
    part("banner").dataset.state = refused().length ? "refused" : waiting ? "waiting" : "sent";
    part("send").hidden = !waiting;
    tick();
  }

  function tick() {
    const now = moment();
    part("clock").textContent = written(running() ? passed(session.running.from, now) : 0);
    const rest = left(now);
    part("left").textContent = written(session ? rest : data.session_ms).slice(0, -4);
    part("left").classList.toggle("bad", Boolean(session) && rest <= 0);
    part("off").textContent = running() ? session.running.off_tracks : 0;
    part("resets").textContent = running() ? session.running.resets : 0;
    if (session && rest <= 0 && !wentOver) { wentOver = true; notice = words.over; part("notice").textContent = notice; }
  }

  // --- buttons, keys, network -------------------------------------------------------------------------------------------
  const work = {
    start: begin, lap: () => lap(true), invalid: () => lap(false), off: () => count("off_tracks"),
    reset: () => count("resets"), undo, end,
  };
  for (const [name, one] of Object.entries(buttons)) {
    one.addEventListener("click", () => work[name]());
    // a button that has just been pressed would be pressed again by the space bar, which is a lap
    one.addEventListener("pointerup", () => one.blur());
  }
  const keys = Object.fromEntries(Object.entries(buttons).map(([name, one]) => [one.dataset.key, name]));
  document.addEventListener("keydown", (event) => {
    if (event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest("input, select, textarea, a, summary")) return;
    const name = event.key === " " ? "lap" : keys[event.key.toLowerCase()];
    if (!name || (event.key === " " && event.target.closest("button"))) return;
    event.preventDefault();
    if (!buttons[name].disabled) work[name]();
  });
  part("send").addEventListener("click", send);
  addEventListener("online", () => { draw(); send(); });
  addEventListener("offline", draw);
  setInterval(send, SEND_AGAIN_MS);
  setInterval(askSensor, ASK_SENSOR_MS);
  setInterval(watch, 500);
  setInterval(tick, 47);

  guests = await store.all("guests");
  for (const each of data.guests) if (!guests.some((one) => one.id === each.id)) guests.push(each);
  if (navigator.serviceWorker) {
    navigator.serviceWorker.register(data.worker).then(() => navigator.serviceWorker.ready)
      .then(() => { root.dataset.kept = "yes"; }).catch(() => {});
  } else part("reload").textContent = words.noReload;
  root.dataset.ready = "yes";
  draw();
  send();
})();
