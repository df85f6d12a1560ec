// Live pages: when the event stream reports a change of a topic in data-follow ("race:7 me"), fetches the page again
// and morphs that part; polls without the stream.
"use strict";

(() => {
  const { body } = document;
  const GAP_MS = 1000; // a page is asked for no more often; where many look, twice the time that they spread over
  const POLL_MS = 5000; // without the stream
  const RARELY = 10; // with it, what is in no table (a progress) is asked for so many times more rarely
  const HIDDEN_MS = 60000; // a page that nobody sees for so long leaves the stream
  const SAID_MS = 2000;
  const SLIDE_MS = 450;
  const LIT_MS = 1800;
  const still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

  // --- morphing: new content is written into the elements on the page (idiomorph) --------------------------------------
  const OWN_ATTRIBUTES = new Set(["tabindex", "role", "aria-label"]); // scripts add them, the server does not send them
  const INPUT_STATE = new Set(["value", "checked", "selected"]);
  const edited = new WeakSet(); // form fields that the reader has changed
  document.addEventListener("input", ({ target }) => edited.add(target), true);

  function beforeAttributeUpdated(name, element, mutation) {
    if (name === "open" || (mutation === "remove" && OWN_ATTRIBUTES.has(name))) return false;
    return !(INPUT_STATE.has(name) && edited.has(element.closest("select") ?? element));
  }

  // idiomorph matches elements by id: rows get theirs from data-key
  function giveIds(part) {
    part.querySelectorAll("[data-key]:not([id])").forEach((row) => {
      row.id = `${row.parentElement.closest("[id]")?.id}-${row.dataset.key}`;
    });
  }

  function morph(old, fresh) {
    const focused = document.activeElement;
    giveIds(old);
    giveIds(fresh);
    const result = Idiomorph.morph(old, fresh, { morphStyle: "outerHTML", callbacks: { beforeAttributeUpdated } });
    if (focused.isConnected && focused !== document.activeElement) focused.focus({ preventScroll: true });
    return result;
  }

  // hx-swap="morph": htmx is loaded after this script
  document.addEventListener("DOMContentLoaded", () => {
    window.htmx?.defineExtension("morph", {
      handleSwap: (style, target, fragment) => style === "morph" && fragment.firstElementChild && morph(target, fragment.firstElementChild),
    });
  });

  // When a swap removes the element with the focus, the focus goes to the heading of the new content.
  let focusedPart = "";
  document.addEventListener("htmx:beforeSwap", ({ detail: { target } }) => {
    focusedPart = target.contains(document.activeElement) && document.activeElement !== body ? target.id : "";
  });
  document.addEventListener("htmx:afterSettle", () => {
    const part = focusedPart && document.activeElement === body && document.getElementById(focusedPart);
    focusedPart = "";
    if (!part) return;
    const heading = part.querySelector("h1, h2") || part;
    heading.tabIndex = -1;
    heading.focus({ preventScroll: true });
  });

  // --- rows slide, times light up ------------------------------------------------------------------------------------
  const rowsOf = (part) => new Map([...part.querySelectorAll("[data-key]")].map((row) => [row.dataset.key, row]));
  const timesOf = (row) => [...row.querySelectorAll(".time")].map((each) => each.textContent.trim());

  function look(part) {
    return new Map([...rowsOf(part)].map(([key, row]) => [key, { top: row.getBoundingClientRect().top, times: timesOf(row) }]));
  }

  function light(element) {
    element.classList.add("lit");
    setTimeout(() => element.classList.remove("lit"), LIT_MS);
  }

  function show(part, seen) {
    const moved = [];
    rowsOf(part).forEach((row, key) => {
      const was = seen.get(key);
      if (!was) {
        if (seen.size) light(row);
        return;
      }
      row.querySelectorAll(".time").forEach((each, which) => {
        if (was.times[which] !== undefined && was.times[which] !== each.textContent.trim()) light(each);
      });
      const by = was.top - row.getBoundingClientRect().top;
      if (Math.abs(by) > 1) moved.push([row, by]);
    });
    if (still()) return;
    moved.forEach(([row, by]) => row.animate(
      [{ transform: `translateY(${by}px)` }, { transform: "none" }],
      { duration: SLIDE_MS, easing: "cubic-bezier(.2, .7, .2, 1)" },
    ));
  }

  function write(part, fresh) {
    document.dispatchEvent(new CustomEvent("paddock:fresh", { detail: fresh }));
    const seen = look(part);
    if (part.nodeName === fresh.nodeName && part.id === fresh.id) morph(part, fresh);
    show(part, seen);
  }

  // --- what is new is said: data-say of an element with an id, one message in two seconds ------------------------------
  const said = new Map();
  const waiting = new Map();
  let last = -Infinity;
  let timer = 0;

  function region() {
    let found = document.querySelector("[data-live-said]");
    if (!found) {
      found = document.createElement("p");
      found.className = "hidden";
      found.setAttribute("role", "status");
      found.dataset.liveSaid = "";
      body.append(found);
    }
    return found;
  }

  function speak() {
    timer = 0;
    if (!waiting.size) return;
    region().textContent = [...waiting.values()].slice(-4).join(" ");
    waiting.clear();
    last = performance.now();
  }

  function listen(first) {
    document.querySelectorAll("[data-say][id]").forEach(({ id, dataset }) => {
      if (said.get(id) === dataset.say) return;
      said.set(id, dataset.say);
      if (!first && dataset.say) waiting.set(id, dataset.say);
    });
    if (waiting.size && !timer) timer = setTimeout(speak, Math.max(0, last + SAID_MS - performance.now()));
  }
  listen(true);
  document.addEventListener("htmx:afterSettle", () => listen(false));

  // --- asking for what moved -----------------------------------------------------------------------------------------
  const partsOf = () => [...document.querySelectorAll("[data-follow]")];
  const topicsOf = (part) => part.dataset.follow.split(" ").filter(Boolean);
  const addressOf = (part) => new URL(part.dataset.from || location.href, location.href).href.split("#")[0];
  const asked = new Map(); // by address: { tag, at, timer, busy, again }
  let spread = 0;
  let isUp = false;

  async function ask(address) {
    const state = asked.get(address);
    state.timer = 0;
    if (state.busy) { state.again = true; return; }
    state.busy = true;
    state.at = performance.now();
    try {
      const headers = { "X-Paddock-Parts": "1" };
      if (state.tag) headers["If-None-Match"] = state.tag;
      if (state.number) headers["X-Paddock-At"] = state.number;
      state.number = 0;
      const answer = await fetch(address, { headers, cache: "no-store", signal: AbortSignal.timeout(15000) });
      if (answer.redirected || [401, 403, 404, 410].includes(answer.status)) {
        if (address === location.href.split("#")[0]) location.reload(); // it is not for this reader any more
      } else if (answer.status === 200) {
        const page = new DOMParser().parseFromString(await answer.text(), "text/html");
        state.tag = answer.headers.get("ETag");
        renew(address, page);
      }
    } catch { /* asked again when it moves, or in a while */ }
    state.busy = false;
    if (state.again) { state.again = false; soon(address, 0, state.prompt); }
  }

  function renew(address, page) {
    let changed = false;
    partsOf().filter((part) => part.id && !part.hasAttribute("hx-get") && addressOf(part) === address).forEach((part) => {
      const fresh = page.getElementById(part.id);
      if (!fresh) return;
      write(part, fresh);
      changed = true;
    });
    if (!changed) return;
    document.dispatchEvent(new CustomEvent("htmx:afterSettle", { bubbles: true }));
    follow();
  }

  // prompt: a page that few look at and that must not wait until many have asked
  function soon(address, number = 0, prompt = false) {
    if (!asked.has(address)) asked.set(address, { at: -Infinity, number: 0 });
    const state = asked.get(address);
    state.number = Math.max(state.number, number);
    state.prompt = prompt;
    if (state.timer) return;
    const over = prompt ? 0 : spread;
    const gap = Math.max(0, state.at + Math.max(GAP_MS, 2 * over) - performance.now());
    state.timer = setTimeout(() => ask(address), gap + Math.random() * over);
  }

  // what htmx asks for: once at a time, for an answer may be the last one
  const again = new WeakSet();
  function nudge(part) {
    if (part.classList.contains("htmx-request")) again.add(part);
    else part.dispatchEvent(new CustomEvent("paddock:moved"));
  }
  document.addEventListener("htmx:afterSettle", () => follow());
  document.addEventListener("htmx:afterRequest", ({ detail: { elt } }) => {
    if (again.delete(elt)) setTimeout(() => { if (elt.isConnected && elt.hasAttribute("hx-get")) nudge(elt); }, 100);
  });

  let missed = false;
  function moved(topics, number = 0) {
    if (document.hidden) { missed = true; return; }
    const all = topics && new Set(topics);
    partsOf().filter((part) => !all || topicsOf(part).some((topic) => all.has(topic))).forEach((part) => {
      if (part.hasAttribute("hx-get")) nudge(part);
      else if (part.id) soon(addressOf(part), number, "prompt" in part.dataset);
    });
  }
  document.addEventListener("paddock:raced", () => { if (!isUp) moved(null); });

  // --- the stream ----------------------------------------------------------------------------------------------------
  let send = null;
  let followed = "";
  let mine = "";

  const tell = (name, detail) => document.dispatchEvent(new CustomEvent(`paddock:${name}`, { detail }));

  // scripts that draw by themselves hear "paddock:stream" ({ up }), "paddock:news" ({ of }) and "paddock:said" ({ to, data })
  function hear(message) {
    if (message.is === "up") { isUp = true; spread = message.spread ?? spread; tell("stream", { up: true }); }
    else if (message.is === "down") { isUp = false; tell("stream", { up: false }); }
    else if (message.is === "moved") {
      // "me" is written by the server with the reader's number
      const of = message.of && message.of.map((topic) => (topic === mine ? "me" : topic));
      moved(of, message.at ?? 0);
      tell("news", { of });
    } else tell(message.is, message);
  }

  function connect() {
    const address = body.dataset.stream;
    if (typeof SharedWorker !== "undefined") {
      const worker = new SharedWorker(address, { name: `paddock ${body.dataset.streamAs || ""}` });
      worker.port.onmessage = ({ data }) => hear(data);
      return (message) => worker.port.postMessage(message);
    }
    const kept = [];
    const script = document.createElement("script");
    script.src = address;
    script.onload = () => kept.splice(0).forEach((each) => window.paddockStream(hear, each));
    document.head.append(script);
    return (message) => (window.paddockStream ? window.paddockStream(hear, message) : kept.push(message));
  }

  function follow() {
    const of = [...new Set(partsOf().flatMap(topicsOf))].sort();
    if (of.join(" ") === followed || document.hidden || !body.dataset.stream) return;
    if (!of.length && !send) return;
    send ??= connect();
    const at = followed ? null : Number(body.dataset.streamAt || NaN);
    followed = of.join(" ");
    send({ is: "follow", of, at: Number.isNaN(at) ? null : at });
  }

  function leave() {
    if (send) send({ is: "leave" });
    followed = "";
    isUp = false;
    tell("stream", { up: false });
  }

  mine = body.dataset.streamAs ? `racer:${body.dataset.streamAs}` : "";
  window.livePage = { follow, moved };
  follow();
  let hidden = 0;
  document.addEventListener("visibilitychange", () => {
    clearTimeout(hidden);
    if (document.hidden) { hidden = setTimeout(leave, HIDDEN_MS); return; }
    const left = !followed;
    follow();
    if (left || missed) moved(null);
    missed = false;
  });
  addEventListener("pagehide", leave);
  addEventListener("pageshow", ({ persisted }) => { if (persisted) { follow(); moved(null); } });
  setInterval(() => { if (send && followed) send({ is: "here" }); }, 20000);

  // --- without the stream, and what is in no table -------------------------------------------------------------------
  const turns = new WeakMap();
  setInterval(() => {
    if (document.hidden) return;
    const now = performance.now();
    partsOf().forEach((part) => {
      const own = Number(part.dataset.poll || 0);
      const pause = isUp ? own * RARELY : own || POLL_MS;
      if (!turns.has(part)) turns.set(part, now + (own ? 0 : Math.random() * 2000));
      if (!pause || now - turns.get(part) < pause) return;
      turns.set(part, now);
      if (part.hasAttribute("hx-get")) nudge(part);
      else if (part.id) soon(addressOf(part));
    });
  }, 250);
})();
