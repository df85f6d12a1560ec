"""Training against a racing line: from nothing to within 25 % of the lap of the minimum-curvature line.

The training is one that a learner chooses in the wizard: reward example "Race", the table of 15 actions that the wizard
makes of 5 steering angles up to 30 degrees and 3 speeds up to 3 m/s (or another ``--speed-limit``), best model by lap
time, everything else as it is.
(With the default actions, 1.4 m/s at most, any car that stays on the road is within 25 %: no curve slows it down.)

Whenever the trainer's own look says that the car is fast enough, the platform's evaluation drives three laps from a
standing start in its own sandbox. The time that counts is wall time from the call that starts the training to the end
of the evaluation whose laps are clean and whose mean lap is near enough; it goes on until there is one.
"""

from __future__ import annotations

import json
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from typing import Any

from evaluation.running.pipeline import RaceJob, evaluate
from paddock.analysis.racing_line import RacingLine, best_line
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.track import TrackGeometry
from paddock.packages.metadata import MetadataDocument, parse_metadata
from paddock.rules.race import RaceRules
from paddock.simulator.physics import PADDOCK_CAR
from training.jobs.settings_checks import discrete_actions
from training.rewards.examples import example
from training.trainer.client import Iteration, Listener, train
from training.trainer.spec import LAP_TIME, TrainerSpec

from .processor import Clock

REWARD = "race"
SPEED_LIMIT_MPS = 3.0
NEAR = 1.25  # times the line's lap
BUDGET_S = 300.0
LAPS = 3


@cache
def track_of(slug: str) -> TrackGeometry:
    """The track of the catalogue, counter-clockwise."""
    return next(entry for entry in CATALOGUE if entry.slug == slug).geometry().in_direction("ccw")


@cache
def line_of(slug: str) -> RacingLine:
    """The minimum-curvature line of the track."""
    return best_line(track_of(slug), PADDOCK_CAR.body_width / 2)


def clean_laps(slug: str, onnx: bytes, metadata: MetadataDocument) -> list[int]:
    """The milliseconds of each lap without a reset in an evaluation of three laps by the platform."""
    checked = parse_metadata(json.dumps(metadata).encode()).to_dict()
    outcome = evaluate(RaceJob(track_of(slug), RaceRules(laps=LAPS), onnx, checked))
    return [lap["time_ms"] for lap in outcome.laps if lap["complete"] and not lap["resets"]]


class _Pace(Listener):
    """Looks for the first policy that is fast enough, until the budget is spent."""

    def __init__(self, slug: str, metadata: MetadataDocument, wanted_s: float, budget_s: float, by_cpu: bool) -> None:
        self.slug, self.metadata, self.wanted_ms = slug, metadata, wanted_s * 1000.0
        self.budget_s, self.by_cpu = budget_s, by_cpu
        self.clock, self.began = Clock(), time.monotonic()
        self.found: dict[str, Any] | None = None
        self.fastest_ms: float | None = None
        self.tried = 0
        self.over = False

    @property
    def wall_s(self) -> float:
        """Since the start."""
        return time.monotonic() - self.began

    def stop(self) -> bool:
        """Whether the training may end."""
        return self.over

    def ready(self) -> None:
        self.clock.look()

    def alive(self, steps: int, seconds: float) -> None:
        self.clock.look()
        self.over |= (self.clock.seconds if self.by_cpu else self.wall_s) >= self.budget_s

    def iteration(self, iteration: Iteration) -> None:
        self.alive(0, 0.0)
        values = iteration.values
        looked_ms = values["eval_lap_ms"]
        if self.over or looked_ms is None or values["eval_clean_laps"] < len(values["eval_trials"]):
            return
        if looked_ms > self.wanted_ms * 1.02:  # its laps begin from a stand: three in a row are a little faster
            return
        self.tried += 1
        laps = clean_laps(self.slug, iteration.onnx, self.metadata)
        if len(laps) < LAPS:
            return
        mean_ms = statistics.mean(laps)
        self.fastest_ms = mean_ms if self.fastest_ms is None else min(self.fastest_ms, mean_ms)
        if mean_ms <= self.wanted_ms:
            self.clock.look()
            self.found = {"wall_s": self.wall_s, "cpu_s": self.clock.seconds, "steps": values["steps"]}
            self.over = True


def to_pace(
    slug: str,
    make: Callable[..., TrainerSpec],
    seed: int,
    *,
    speed_limit: float = SPEED_LIMIT_MPS,
    by_cpu: bool = False,
    near: float = NEAR,
    budget_s: float = BUDGET_S,
) -> dict[str, Any]:
    """One training until its car's lap is at most ``near`` times the line's or the budget is spent. ``make``: the
    wizard's training by ``(slug, seed, **changes)``. ``by_cpu``: the budget is processor time."""
    line_s = line_of(slug).lap_s(speed_limit)
    actions = discrete_actions(30.0, 5, speed_limit, 3)
    spec = make(slug, seed, stop_clean_laps=None, best_metric=LAP_TIME, reward_code=example(REWARD).code)
    metadata: MetadataDocument = {**spec.metadata, "action_space_type": "discrete", "action_space": actions}
    spec = TrainerSpec(**{**asdict(spec), "metadata": metadata, "stop_seconds": budget_s * (20.0 if by_cpu else 1.0)})
    notes = _Pace(slug, metadata, near * line_s, budget_s, by_cpu)
    train(spec, notes, asked_to_stop=notes.stop)
    notes.clock.close()
    spent = {"wall_s": notes.wall_s, "cpu_s": notes.clock.seconds, "steps": None}
    lap_s = None if notes.fastest_ms is None else notes.fastest_ms / 1000.0
    return {
        "seed": seed,
        "reached": notes.found is not None,
        **(notes.found or spent),
        "lap_s": lap_s,
        "of_line": None if lap_s is None else lap_s / line_s,
        "evaluations": notes.tried,
    }


def measure(
    slug: str,
    make: Callable[..., TrainerSpec],
    seeds: int,
    *,
    speed_limit: float = SPEED_LIMIT_MPS,
    by_cpu: bool = False,
    near: float = NEAR,
    budget_s: float = BUDGET_S,
) -> dict[str, Any]:
    """All seeds on one track, and medians. A run that did not get there counts as one that never will."""
    runs = [
        to_pace(slug, make, seed, speed_limit=speed_limit, by_cpu=by_cpu, near=near, budget_s=budget_s)
        for seed in range(seeds)
    ]
    line = line_of(slug)

    def middle(name: str) -> float | None:
        value = statistics.median(run[name] if run["reached"] else math.inf for run in runs)
        return value if math.isfinite(value) else None

    return {
        "speed_limit_mps": speed_limit,
        "line_m": line.length,
        "line_lap_s": line.lap_s(speed_limit),
        "near": near,
        "wanted_lap_s": near * line.lap_s(speed_limit),
        "budget_s": budget_s,
        "budget_in": "processor time" if by_cpu else "wall time",
        **{name: middle(name) for name in ("wall_s", "cpu_s", "steps", "lap_s", "of_line")},
        "reached": sum(run["reached"] for run in runs),
        "runs": runs,
    }
