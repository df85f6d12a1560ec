// Replays a live event run by run, by the viewer's player: loads before live/show.js, in place of live/live-feed.js, and
// gives the same data.
import { isStill } from "../viewer/stage.js";
import { Viewer } from "../viewer/viewer.js";

const LEAD_MS = 3000; // so long before its start a run is announced
const TAIL_MS = 6000; // from the end of a run to the next
const LOOK_MS = 2000; // of it, until the standings have the run
const acts = document.querySelector("[data-again]");
const act = (name) => acts.querySelector(`[data-act="${name}"]`);

// Each run has its own clock, which begins with its announcement.
class Feed {
  constructor({ poses }, hear) {
    Object.assign(this, { poses, hear, lead: LEAD_MS, tail: TAIL_MS, chunks: new Map(), told: "", at: 0 });
    this.clock = { known: true, now: () => this.player?.now ?? 0 };
    acts.addEventListener("click", ({ target }) => {
      if (target.dataset.act === "skip") this.player.seek(this.player.replay.duration - TAIL_MS + LOOK_MS + 1);
      if (target.dataset.act === "next") this.to(this.at + 1);
    });
    act("run").addEventListener("change", ({ target }) => this.to(Number(target.value)));
    document.addEventListener("visibilitychange", () => this.hide());
  }

  async mount({ player }) {
    try {
      const answer = await this.ask(acts.dataset.again);
      Object.assign(this, answer, { player });
    } catch { setTimeout(() => this.mount({ player }), 3000); return; }
    act("run").replaceChildren(...this.steps.map(({ state }, at) => new Option(`${acts.dataset.run.replace("%s", at + 1)}: ${state.current.racer}`, at)));
    acts.querySelectorAll("[data-act]").forEach((each) => { each.disabled = false; });
    player.addEventListener("time", () => this.tick());
    player.addEventListener("end", () => { this.to(this.at + 1); if (this.steps[this.at]) player.play(); });
    player.addEventListener("change", () => { if (player.playing && !this.steps[this.at]) this.to(0); });
    this.to(0);
    if (!isStill()) player.play();
  }

  async ask(address) {
    const answer = await fetch(address, { headers: { Accept: "application/json" }, signal: AbortSignal.timeout(15000) });
    if (!answer.ok) throw new Error(String(answer.status));
    return answer.json();
  }

  // --- the times of announcements ---------------------------------------------------------------------------------------------
  tick() {
    const step = this.steps[this.at];
    const over = step && this.player.now > this.player.replay.duration - TAIL_MS + LOOK_MS;
    const which = step ? `${this.at}${over ? "-after" : ""}` : "end";
    if (which === this.told) return;
    this.told = which;
    act("skip").disabled = over || !step;
    act("next").disabled = !step;
    const state = step ? (over ? step.after : step.state) : this.end;
    if (state.current) state.current.starts_at = LEAD_MS;
    this.hear.state({ ...state, behind_ms: 0 });
    if (!step) this.watched();
  }

  async play(current) {
    this.current = current;
    if (!current) return;
    const of = current.slot;
    const is = () => this.current?.slot === of;
    try {
      if (!this.chunks.has(of)) this.chunks.set(of, await this.load(of));
      if (is()) this.hear.poses({ slot: of, chunks: this.chunks.get(of), over: true, before: null });
    } catch { setTimeout(() => { if (is()) this.play(current); }, 2000); }
  }

  async load(slot) {
    const chunks = [];
    for (let over = false; !over;) {
      const said = await this.ask(`${this.poses}?slot=${slot}&after=${chunks.at(-1)?.n ?? -1}`);
      chunks.push(...said.chunks);
      over = said.over || !said.chunks.length;
    }
    return chunks;
  }

  // --- what the reader does --------------------------------------------------------------------------------------------
  // To just before the start of a run; behind the last, to the podium.
  to(number) {
    this.at = number;
    if (this.steps[number]) act("run").value = String(number);
    this.told = "";
    this.player.seek(0);
    if (!this.steps[number]) this.player.pause();
  }

  // Nobody watches: it stands until somebody does.
  hide() {
    if (document.hidden) { this.slept = this.player?.playing; this.player?.pause(); } else if (this.slept) this.player.play();
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

window.paddockFeed = { Feed, Stage: Viewer };
