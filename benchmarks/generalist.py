"""``python -m benchmarks.generalist [--json]``: does one training make a car that laps tracks which it has never seen?

The training is the one that the wizard proposes for an all-round car (``training/wizard/all_round.py``: eight tracks,
both directions, light, colours and starts drawn anew), behind the sandbox and alone, for its 15 minutes of wall time.
Its best model then drives three laps by the platform's own evaluation on twelve tracks that it has never seen, and on
its own eight: a track counts as lapped when one of the three laps has no fault. Promised: 10 of the 12.

``--minutes`` and ``--unseen`` make it shorter; then nothing is promised. ``--shared``: on a machine that does other
things the minutes are of processor time; the trainer is one process with one thread, so on an idle machine the two are
the same.
"""

from __future__ import annotations

import math
import os
import sys
import time
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from paddock.rules.training import randomisation
from training.trainer.client import Iteration, Listener, train
from training.trainer.spec import TrainerSpec
from training.wizard import all_round

from .machine import measured_on
from .processor import Clock
from .racing_pace import clean_laps, track_of
from .report import command, report
from .training import METADATA, wizard_spec

UNSEEN = (
    *("kuei-raceway", "kuei-super-raceway", "cosmic-loop", "cosmic-circuit", "baja-turnpike", "baja-highway"),
    *("2022-reinvent-championship", "oval-track", "bowtie-track", "london-loop-training", "sola-speedway"),
    "ross-raceway",
)
WANTED = 10


def all_round_spec(seed: int, minutes: float) -> TrainerSpec:
    """The training that the wizard proposes, with this seed."""
    first, *more = all_round.TRACKS
    return wizard_spec(
        first,
        seed,
        more_tracks=[{"track": track_of(slug).to_dict(), "look": "official"} for slug in more],
        alternate_direction=all_round.SETTINGS["alternate_direction"],
        randomise=randomisation(all_round.SETTINGS),
        trials=all_round.SETTINGS["trials"],
        stop_clean_laps=None,
        stop_seconds=60.0 * minutes,
    )


class _Best(Listener):
    """Keeps the best model and how the evaluations went. ``cpu_s``: processor time after which it asks for the end."""

    def __init__(self, cpu_s: float = math.inf) -> None:
        self.cpu_s = cpu_s
        self.onnx = b""
        self.progress: list[tuple[float, float]] = []  # seconds, percent over all ways
        self.clock = Clock()

    def ready(self) -> None:
        self.clock.look()

    def alive(self, steps: int, seconds: float) -> None:
        self.clock.look()

    def is_over(self) -> bool:
        """Whether the processor time is spent."""
        return self.clock.seconds >= self.cpu_s

    def iteration(self, iteration: Iteration) -> None:
        self.clock.look()
        self.progress.append((iteration.values["seconds"], iteration.values["eval_progress"]))
        if iteration.values["is_best"]:
            self.onnx = iteration.onnx


def run(seed: int, minutes: float, unseen: tuple[str, ...], shared: bool = False) -> dict[str, Any]:
    """All figures as JSON values. ``shared``: minutes of processor time."""
    load, began = os.getloadavg()[0], time.monotonic()
    best = _Best(60.0 * minutes if shared else math.inf)
    spec = all_round_spec(seed, 20.0 * minutes if shared else minutes)
    ended = train(spec, best, asked_to_stop=best.is_over)
    wall_s = time.monotonic() - began
    best.clock.close()
    laps = {slug: clean_laps(slug, best.onnx, METADATA) for slug in (*all_round.TRACKS, *unseen)}
    return {
        "machine": measured_on(load),
        "seed": seed,
        "minutes": minutes,
        "wall_s": wall_s,
        "cpu_s": best.clock.seconds,
        "steps": ended.steps,
        "evaluations": [{"seconds": seconds, "progress": percent} for seconds, percent in best.progress],
        "trained_on": {slug: laps[slug] for slug in all_round.TRACKS},
        "unseen": {slug: laps[slug] for slug in unseen},
        "lapped": sum(bool(laps[slug]) for slug in unseen),
    }


def misses(figures: dict[str, Any]) -> list[str]:
    """The promise, where these figures break it; a shorter measurement promises nothing."""
    whole = figures["minutes"] >= all_round.SETTINGS["stop_minutes"] and len(figures["unseen"]) == len(UNSEEN)
    if not whole or figures["lapped"] >= WANTED:
        return []
    return [f"{figures['lapped']} of {len(UNSEEN)} unseen tracks were lapped, {WANTED} are promised"]


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine = figures["machine"]
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores, load {machine['load_before']} to {machine['load_after']}; "
        f"{machine['engine']}; seed {figures['seed']}",
        f"{figures['minutes']:g} minutes on {len(all_round.TRACKS)} tracks: {figures['steps']} steps, "
        f"{figures['cpu_s']:.0f} s of processor time",
    ]
    for title, key in (("Trained on", "trained_on"), ("Never seen", "unseen")):
        lines += ["", f"{title:32}{'clean laps':>12}{'fastest':>10}"]
        for slug, laps in figures[key].items():
            lines.append(f"{slug:32}{len(laps):>12}{f'{min(laps) / 1000:.3f}' if laps else '-':>10}")
    lines += ["", f"Lapped {figures['lapped']} of {len(figures['unseen'])} tracks that it had never seen."]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = command("generalist", "One training, and tracks that its car has never seen.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=all_round.SETTINGS["stop_minutes"])
    parser.add_argument("--unseen", nargs="+", default=list(UNSEEN), choices=UNSEEN, help="drive these only")
    parser.add_argument("--shared", action="store_true", help="the machine does other things: see above")
    options = parser.parse_args(arguments)
    figures = run(options.seed, options.minutes, tuple(options.unseen), options.shared)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
