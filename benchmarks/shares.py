"""Speed as shares of what cannot be less: ``python -m benchmarks.evaluation --shares [--json]``.

Six figures, each a ratio or a time of runs as a worker drives them (sandboxed, their processes waiting for them), each
with its bound. Bullet's step, the network and the camera are what a run cannot do without; all else is the platform's
own, and so is the start. Within ten minutes on two idle cores; on a machine that does other things all but the first
two say little.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import time
from dataclasses import dataclass
from multiprocessing.synchronize import Barrier
from typing import Any

from evaluation.running.pipeline import RaceJob, evaluate
from evaluation.running.process_pool import ProcessPool
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules

from . import racing_pace, renderers, whole
from .machine import measured_on
from .models import CONSOLE, AdmittedCar
from .training import lapping, wizard_spec

OWN_SHARE = {CONSOLE: 0.05}  # of a run, at most: what is neither Bullet nor network nor camera
OWN_SHARE_OF_HOUSE_CARS = 0.10
FRAME_OF_STEP = 0.5  # at most: a frame, by Bullet's step
START_S = 0.030
AT_ONCE, CORES, LOSS = 8, 2, 0.10
TINY_RENDERER = 12.0
# On Kuei Raceway the first laps take 3,000 to 16,000 control steps: three of five seeds take its tightest bend soon.
# Two do not for as long as they explore: it is as tight as the car turns. See docs/operators.md.
FIRST_LAPS_S = {"oval": 5.0, "kuei-raceway": 8.0}
LINE_TRACK, LINE_NEAR, LINE_BUDGET_S = "kuei-raceway", 1.10, 60.0
SEEDS = 5
PARTS = ("run", "many", "renderer", "training")


@dataclass(frozen=True)
class Figure:
    """One figure and its bound; ``at_most`` False: it is a least. ``value`` is None where there is none to tell."""

    what: str
    value: float | None
    bound: float
    unit: str = ""
    at_most: bool = True

    @property
    def met(self) -> bool:
        """Whether the bound is kept."""
        if self.value is None:
            return False
        return self.value <= self.bound if self.at_most else self.value >= self.bound

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            **{"what": self.what, "value": self.value, "bound": self.bound, "unit": self.unit},
            **{"at_most": self.at_most, "met": self.met},
        }

    def __str__(self) -> str:
        kind = "at most" if self.at_most else "at least"
        return f"{self.what:78}{_number(self.value, self.unit):>10}  {kind} {_number(self.bound, self.unit):9}" + (
            "met" if self.met else "NOT MET"
        )


def _number(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    return f"{value:.1%}" if unit == "%" else f"{value:.4g} {unit}".rstrip()


def measure(
    cars: list[AdmittedCar], track: TrackGeometry, *, laps: int, runs: int, seeds: int, parts: tuple[str, ...]
) -> dict[str, Any]:
    """All figures as JSON values. ``cars``: a house car last. The runs are of ``laps`` laps, each figure of them the
    median of ``runs``."""
    load, figures, found = os.getloadavg()[0], [], {}
    if "run" in parts:
        found = {car.name: whole.measure(car, track, laps=laps, runs=runs) for car in cars}
        figures += _of_runs(found)
    house = cars[-1]
    if "many" in parts:
        job = RaceJob(track, RaceRules(laps=4 * laps), house.onnx, house.metadata, facts=house.facts)
        figures.append(at_once(job, runs=runs))
    if "renderer" in parts:
        ratio = renderers.compare(house, track, steps=300)["ratio"]
        what = f"A run of {house.name} without a sandbox, by the same with TinyRenderer"
        figures.append(Figure(what, ratio, TINY_RENDERER, "times", at_most=False))
    if "training" in parts:
        figures += _of_training(seeds)
    return {
        "machine": measured_on(load),
        "figures": [figure.to_dict() for figure in figures],
        "table": [str(figure) for figure in figures],
        "us_per_step": {name: _by_step(one) for name, one in found.items()},
    }


def _of_runs(found: dict[str, dict[str, Any]]) -> list[Figure]:
    shares, frames, starts = [], [], []
    for name, run in found.items():
        parts = run["shares"]
        driving = 1.0 - parts["start"]
        bound = OWN_SHARE.get(name, OWN_SHARE_OF_HOUSE_CARS)
        what = f"{name}: neither Bullet nor network nor camera, of the run without its start"
        shares.append(Figure(what, (parts["pipes"] + parts["other"]) / driving, bound, "%"))
        what = f"{name}: a frame, by Bullet's step"
        frames.append(Figure(what, parts["camera"] / parts["physics"], FRAME_OF_STEP, "%"))
        starts.append(Figure(f"{name}: start with waiting processes", parts["start"] * run["wall_s"], START_S, "s"))
    return shares + frames + starts


def _by_step(run: dict[str, Any]) -> dict[str, float]:
    """Microseconds of a control step by part."""
    driving = 1.0 - run["shares"]["start"]
    return {name: run["us_per_step"] * share / driving for name, share in run["shares"].items() if name != "start"}


def at_once(job: RaceJob, *, runs: int) -> Figure:
    """How much slower than on two cores for themselves runs are that are driven at once, more than there are cores.

    Each round is held against runs alone just before it, from the first word to the last process that is gone. Told
    beside it: what as many runs as there are cores lose, each with a core for itself; that much is the machine's.
    """
    lost, floor = [], []
    for _ in range(runs):
        alone_s = statistics.median([_together_s(job, 1, 1) for _ in range(3)])
        floor.append(1.0 - alone_s / _together_s(job, CORES, CORES))
        lost.append(1.0 - AT_ONCE / _together_s(job, AT_ONCE, CORES) * alone_s / CORES)
    what = f"{AT_ONCE} runs at once on {CORES} cores: lost of twice one core's rate ({CORES} at once lose"
    return Figure(f"{what} {statistics.median(floor):.0%})", statistics.median(lost), LOSS, "%")


def _together_s(job: RaceJob, count: int, cores: int) -> float:
    """Seconds of so many runs that begin together, until the last is over."""
    context = multiprocessing.get_context("spawn")
    barrier, times = context.Barrier(count), context.SimpleQueue()
    drivers = [context.Process(target=_among, args=(job, barrier, times, cores)) for _ in range(count)]
    for driver in drivers:
        driver.start()
    spans = [times.get() for _ in drivers]
    for driver in drivers:
        driver.join()
    return max(end for _, end in spans) - min(begin for begin, _ in spans)


def _among(job: RaceJob, barrier: Barrier, times: Any, cores: int) -> None:
    """One of several runs that begin together; tells when it began and ended, by the clock that all share."""
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-cores:])
    pool = ProcessPool(venues=[job.venue])
    time.sleep(whole.READY_S * max(1.0, barrier.parties / cores))
    while pool.runner.wants_processor():
        time.sleep(whole.READY_S)
    barrier.wait()
    began = time.monotonic()
    evaluate(job, pool=pool)
    times.put((began, time.monotonic()))
    barrier.wait()  # a worker lives on: to end takes a process time that the others would lack


def _of_training(seeds: int) -> list[Figure]:
    figures = []
    for slug, bound in FIRST_LAPS_S.items():
        found = lapping(slug, wizard_spec, seeds)
        what = f"{slug}: from nothing to three clean laps, all included, the slowest of {seeds} seeds"
        worst = max(one["wall_s"] for one in found["runs"]) if found["lapped"] == seeds else None
        figures.append(Figure(what, worst, bound, "s"))
        what = f"{slug}: the same, the median"
        figures.append(Figure(what, found["wall_s"] if found["lapped"] > seeds / 2 else None, bound, "s"))
    near = racing_pace.measure(LINE_TRACK, wizard_spec, seeds, near=LINE_NEAR, budget_s=LINE_BUDGET_S)
    what = f"{LINE_TRACK}: seeds within {LINE_NEAR - 1:.0%} of the minimum-curvature line in {LINE_BUDGET_S:.0f} s"
    figures.append(Figure(what, near["reached"], seeds, f"of {seeds}", at_most=False))
    return figures


def misses(figures: dict[str, Any]) -> list[str]:
    """The bounds that are not kept."""
    return [line for line, one in zip(figures["table"], figures["figures"], strict=True) if not one["met"]]


def table(figures: dict[str, Any]) -> str:
    """The same figures for people."""
    machine = figures["machine"]
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores, load {machine['load_before']} to {machine['load_after']}; "
        f"{machine['engine']}",
        "",
        *figures["table"],
        "",
    ]
    for name, parts in figures["us_per_step"].items():
        lines.append(f"{name:10} us a step: " + ", ".join(f"{part} {us:.0f}" for part, us in parts.items()))
    return "\n".join(lines)
