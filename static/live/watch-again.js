// Replays a live event by a clock that can be paused and moved: loads before live/show.js, in place of
// live/live-feed.js, and gives the same data.
"use strict";

(() => {
  const TICK_MS = 100;
  const BEFORE_MS = 3000; // so long before its start a run that was chosen is announced
  const acts = document.querySelector("[data-again]");
  const act = (name) => acts.querySelector(`[data-act="${name}"]`);
  const copy = (state) => structuredClone(state); // screens write best sectors into theirs

  // Milliseconds since the show began.
  class OwnClock {
    constructor() { this.at = 0; this.since = null; this.known = true; }
    now() { return this.at + (this.since === null ? 0 : performance.now() - this.since); }
    go() { this.since ??= performance.now(); }
    stop() { this.at = this.now(); this.since = null; }
    move(at) { const runs = this.since !== null; this.at = at; this.since = runs ? performance.now() : null; }
  }

  class Feed {
    constructor({ poses }, hear) {
      Object.assign(this, { poses, hear, clock: new OwnClock(), told: "", moves: 0 });
      acts.addEventListener("click", ({ target }) => this.press(target.dataset.act));
      act("run").addEventListener("change", ({ target }) => this.to(Number(target.value)));
      document.addEventListener("visibilitychange", () => this.hide());
      this.begin();
    }

    async begin() {
      try {
        const answer = await fetch(acts.dataset.again, { headers: { Accept: "application/json" }, signal: AbortSignal.timeout(15000) });
        if (!answer.ok) throw new Error(String(answer.status));
        Object.assign(this, await answer.json());
      } catch { setTimeout(() => this.begin(), 3000); return; }
      act("run").replaceChildren(...this.steps.map(({ state }, at) => new Option(`${acts.dataset.run.replace("%s", at + 1)}: ${state.current.racer}`, at)));
      acts.querySelectorAll("[data-act]").forEach((each) => { each.disabled = false; });
      this.clock.go();
      setInterval(() => this.tick(), TICK_MS);
      this.tick();
    }

    // --- what is told when ---------------------------------------------------------------------------------------------
    // The run that is announced, played or was played last; -1 before the first.
    get at() {
      const now = this.clock.now();
      let found = 0;
      while (found + 1 < this.steps.length && now >= this.steps[found + 1].starts_ms - BEFORE_MS) found += 1;
      return this.steps.length ? found : -1;
    }

    tick() {
      const [number, now] = [this.at, this.clock.now()];
      const step = this.steps[number];
      const over = !step || now >= step.ends_ms;
      const ends = over && number === this.steps.length - 1;
      const which = ends ? "end" : `${number}${over ? "-after" : ""}`;
      if (which === this.told) return;
      this.told = which;
      if (number >= 0) act("run").value = String(number);
      act("skip").disabled = over;
      act("next").disabled = ends;
      const state = copy(ends ? this.end : over ? step.after : step.state);
      if (state.current) state.current.starts_at += this.moves / 1e6; // a run that is played anew is another one
      this.hear.state(state);
      if (ends) this.watched();
    }

    async play(current) {
      this.current = current;
      if (!current) return;
      const of = current.slot;
      const is = () => this.current && this.current.slot === of;
      let after = -1;
      try {
        for (let over = false; !over && is();) {
          const answer = await fetch(`${this.poses}?slot=${of}&after=${after}`, { headers: { Accept: "application/json" }, signal: AbortSignal.timeout(15000) });
          if (!answer.ok) throw new Error(String(answer.status));
          const said = await answer.json();
          if (!is()) return;
          if (said.chunks.length) after = said.chunks[said.chunks.length - 1].n;
          over = said.over || !said.chunks.length;
          this.hear.poses({ slot: of, chunks: said.chunks, over, before: null });
        }
      } catch { setTimeout(() => { if (is() && after < 0) this.play(current); }, 2000); }
    }

    // --- what the reader does --------------------------------------------------------------------------------------------
    press(name) {
      if (name === "pause") this.toggle();
      if (name === "skip" && this.at >= 0) this.move(this.steps[this.at].ends_ms);
      if (name === "next") this.to(this.at + 1);
    }

    toggle() {
      const stopped = this.clock.since === null;
      if (stopped) this.clock.go(); else this.clock.stop();
      act("pause").textContent = stopped ? acts.dataset.pause : acts.dataset.play;
    }

    // To just before the start of a run; behind the last, to the podium.
    to(number) {
      const step = this.steps[number];
      this.move(step ? step.starts_ms - BEFORE_MS : this.steps[this.steps.length - 1].ends_ms);
    }

    move(at) {
      this.clock.move(at);
      this.told = "";
      this.moves += 1;
      this.tick();
    }

    // Nobody watches: it stands until somebody does.
    hide() {
      if (document.hidden) { this.slept = this.clock.since !== null; this.clock.stop(); } else if (this.slept) this.clock.go();
    }

    async watched() {
      const form = document.querySelector("[data-watched]");
      if (!form || this.sent) return;
      this.sent = true;
      try {
        await fetch(form.action, { method: "POST", body: new FormData(form), headers: { Accept: "application/json" } });
        form.hidden = true;
      } catch { this.sent = false; }
    }
  }

  window.paddockFeed = { Feed };
})();
