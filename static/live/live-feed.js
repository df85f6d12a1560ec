// Gives the pages of a live event its state, reactions and passed poses, from the stream or by polling with back-off,
// timed by the server's clock.
"use strict";

(() => {
  const CLOCK = "/stream/clock";
  const TICK_MS = 250;
  const LOOK_MS = 1000; // without the stream
  const FETCH_MS = 500;
  const TRIPS = 3; // an answer that took longer than it should is asked for again after so many times what it took more
  const TRIP_MS = 300;
  const WELCOME_MS = 1500; // so long a page waits for what the stream tells who has come
  const MISSED_MS = 2500; // what moved is told of within that
  const LATE_CHUNKS = 3; // so many chunks late, poses are asked for though there is a stream, if it says nothing either
  const SILENT_MS = 1500;
  const SAMPLES = 8;
  const AT_START = 3; // round trips when something begins; later one now and then
  const AGAIN_MS = 30000;
  const SPREAD_MS = 5000;
  const OFF_MS = 250;
  const SLEPT_MS = 10000;

  // The server's clock: of the last round trips the shortest says best how far it is off.
  class ServerClock {
    constructor() { this.forget(); }
    forget() { this.samples = []; }
    add(sent, received, server) {
      const fresh = { trip: received - sent, offset: server - (sent + received) / 2 };
      // each is off by half its trip at most: what cannot both be true is of before and after a sleep
      this.samples = this.samples.filter((one) => Math.abs(one.offset - fresh.offset) <= (one.trip + fresh.trip) / 2 + OFF_MS);
      this.samples.push(fresh);
      if (this.samples.length > SAMPLES) this.samples.shift();
      this.offset = this.samples.reduce((best, one) => (one.trip < best.trip ? one : best)).offset;
    }
    get known() { return this.offset !== undefined; }
    now() { return performance.now() + (this.offset ?? 0); }
  }

  // hear: { state(state), reactions(counts), poses({ slot, chunks, over, before }) }; chunks come in order, none twice.
  class Feed {
    constructor({ topic, state, poses }, hear) {
      Object.assign(this, { topic, addresses: { state, poses }, hear, clock: new ServerClock() });
      this.born = performance.now();
      this.upAt = null; // since when the stream is there
      this.toldAt = -Infinity; // when the state was last told
      this.lookAt = this.born + WELCOME_MS;
      this.fetchAt = 0;
      this.heardAt = -Infinity; // when the stream last spoke of the run on track
      this.missed = false;
      this.pause = { look: LOOK_MS, fetch: FETCH_MS };
      this.play(null);
      this.measure(AT_START);
      document.addEventListener("paddock:said", ({ detail: { to, data } }) => { if (to === topic) this.said(data); });
      document.addEventListener("paddock:stream", ({ detail: { up } }) => this.stream(up));
      document.addEventListener("paddock:news", ({ detail: { of } }) => { if (!of || of.includes(topic)) this.moved(); });
      document.addEventListener("visibilitychange", () => { if (!document.hidden) this.wake(); });
      setInterval(() => this.tick(), TICK_MS);
    }

    get streams() { return this.upAt !== null && this.toldAt >= this.upAt; }

    stream(up) {
      if (up) this.upAt ??= performance.now();
      else { this.upAt = null; this.lookAt = Math.min(this.lookAt, performance.now() + Math.random() * LOOK_MS); }
      if (up && !this.streams) this.lookAt = performance.now() + WELCOME_MS;
    }

    // The state comes with what moved; if it does not, it is asked for.
    moved() {
      if (!this.streams) return;
      this.missed = true;
      this.lookAt = performance.now() + MISSED_MS * (1 + Math.random());
    }

    wake() {
      this.clock.forget();
      this.measure(AT_START);
      if (!this.streams) this.lookAt = Math.min(this.lookAt, performance.now() + 200);
    }

    said(data) {
      this.upAt ??= performance.now(); // what is told to who comes is told before all else
      if (data.state) this.take(data.state);
      if (data.reactions) this.hear.reactions(data.reactions);
      if (data.poses) this.add(data.poses, true);
    }

    // --- the state -------------------------------------------------------------------------------------------------
    take(state) {
      if (state.look !== undefined) { // too large for the stream
        if (state.look !== this.looked) this.lookAt = performance.now() + Math.random() * 2000;
        this.looked = state.look;
        return;
      }
      this.toldAt = performance.now();
      this.missed = false;
      this.chunk = state.chunk_ms;
      const { now, reactions, order, bracket, ...rest } = state;
      if (bracket) rest.drawn = bracket.length > 0;
      const seen = JSON.stringify(rest);
      if (reactions) this.hear.reactions(reactions);
      if (seen === this.seen) return;
      const first = this.seen === undefined;
      this.seen = seen;
      if (!first && window.livePage) window.livePage.moved([this.topic]);
      this.hear.state(rest);
    }

    // Which run is played from now on; null: none.
    play(current) {
      this.current = current;
      this.after = -1;
      this.over = false;
      this.waits = false;
      if (current) this.measure(AT_START);
    }

    // --- poses -----------------------------------------------------------------------------------------------------
    add({ slot, chunks, over, before }, streamed) {
      if (!this.current || this.current.slot !== slot || this.over) return;
      if (streamed) this.heardAt = performance.now();
      const gap = chunks.length && chunks[0].n > this.after + 1;
      if (gap && !before) { // something was missed: asked for
        if (!this.waits && streamed) this.fetchAt = performance.now() + Math.random() * 300;
        this.waits = true;
        return;
      }
      const fresh = chunks.filter(({ n }) => n > this.after);
      if (fresh.length) this.after = fresh[fresh.length - 1].n;
      if (streamed && fresh.length) this.check(this.after);
      this.waits = false;
      this.over = over;
      if (fresh.length || over) this.hear.poses({ chunks: fresh, over, before: gap ? before : null });
    }

    // What has passed by the server's clock has passed by ours, or ours is wrong: a browser slept.
    check(n) {
      const ahead = this.current.starts_at + (n + 1) * this.chunk - this.clock.now();
      if (ahead > OFF_MS && performance.now() - (this.checkedAt ?? -Infinity) > 2000) {
        this.checkedAt = performance.now();
        this.clock.forget();
        this.measure(AT_START);
      }
    }

    late() { return Math.floor((this.clock.now() - this.current.starts_at) / this.chunk) - 1 - this.after; }

    // --- asking ------------------------------------------------------------------------------------------------------
    tick() {
      const asleep = Date.now() - (this.tickedAt ?? Infinity) > SLEPT_MS; // the other clock may have stood still
      this.tickedAt = Date.now();
      if (document.hidden) return;
      if (asleep) this.wake();
      const now = performance.now();
      if (now >= this.lookAt && (!this.streams || this.missed || this.looked !== undefined)) this.look();
      if (this.current && now - this.measuredAt > AGAIN_MS) this.measure(1);
      if (!this.current || this.over || !this.clock.known || now < this.fetchAt) return;
      const late = this.late();
      const silent = now - this.heardAt > SILENT_MS;
      if (this.waits || (this.streams ? silent && late >= LATE_CHUNKS : late >= 1)) this.fetch();
    }

    async ask(address, what, tag = null) {
      const headers = { Accept: "application/json", "X-Paddock-Parts": "1" };
      if (tag) headers["If-None-Match"] = tag;
      const sent = performance.now();
      try {
        return await fetch(address, { headers, cache: "no-store", signal: AbortSignal.timeout(15000) });
      } finally {
        const least = what === "look" ? LOOK_MS : FETCH_MS;
        this.pause[what] = Math.min(5000, Math.max(least, TRIPS * (performance.now() - sent - TRIP_MS))) * (0.8 + 0.4 * Math.random());
      }
    }

    async look() {
      this.lookAt = Infinity;
      try {
        const answer = await this.ask(this.addresses.state, "look", this.tag);
        if (answer.status === 304) { this.toldAt = performance.now(); this.missed = false; }
        else if (answer.ok) {
          this.tag = answer.headers.get("ETag");
          this.looked = undefined;
          this.take(await answer.json());
        }
      } catch { /* the next look is soon */ }
      this.lookAt = performance.now() + this.pause.look;
    }

    async fetch() {
      const of = this.current.slot;
      this.fetchAt = Infinity;
      try {
        for (let more = true; more;) {
          const answer = await this.ask(`${this.addresses.poses}?slot=${of}&after=${this.after}`, "fetch");
          if (!answer.ok) throw new Error(String(answer.status));
          const said = await answer.json();
          if (!this.current || this.current.slot !== of) break;
          this.add(said, false);
          more = said.chunks.length >= 100 && !this.over; // somebody came late: the rest at once
        }
      } catch { /* asked again soon */ }
      this.fetchAt = performance.now() + this.pause.fetch;
    }

    async measure(times) {
      if (this.measuring) return;
      this.measuring = true;
      // what begins, begins for all: they do not all ask at once
      if (this.clock.known && times > 1) await new Promise((done) => setTimeout(done, SPREAD_MS * Math.random()));
      for (let time = 0; time < times; time += 1) {
        if (time) await new Promise((done) => setTimeout(done, 300 + 700 * Math.random()));
        this.measuredAt = performance.now();
        try {
          const answer = await fetch(CLOCK, { cache: "no-store", signal: AbortSignal.timeout(5000) });
          const received = performance.now();
          this.clock.add(this.measuredAt, received, (await answer.json()).now);
        } catch { this.measuredAt = performance.now() - AGAIN_MS + 2000; }
      }
      this.measuring = false;
    }
  }

  window.paddockFeed = { Feed, ServerClock };
})();
