"""Whole evaluations in the sandbox on one core: speed, where the time goes, memory.

As a worker runs them: the two processes were started while it had nothing to do, and wait for another race on the track
of the last one. ``cold_factor`` is for an evaluation that has to start them itself.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import statistics
import time
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from evaluation.running.pipeline import EvaluationOutcome, RaceJob, evaluate
from evaluation.running.process_pool import ProcessPool
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import RaceRules

from .models import AdmittedCar
from .processor import Clock

MEGABYTE = 1024.0  # of ru_maxrss, which counts in kilobytes
READY_S = 1.5  # on an idle machine both processes have long imported and rehearsed everything by then
IN_BULLET_AND_NETWORK = ("physics", "network")


def measure(car: AdmittedCar, track: TrackGeometry, *, laps: int, runs: int) -> dict[str, Any]:
    """The medians of ``runs`` evaluations in a fresh process that is pinned to one core, with all its children."""
    job = RaceJob(track, RaceRules(laps=laps), car.onnx, car.metadata, facts=car.facts)
    # A fresh process: the memory of this one is not that of an evaluation.
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        found = pool.submit(_runs, job, runs).result()
    return {key: _median([run[key] for run in found]) for key in found[0]}


def pin_to_one_core() -> None:
    """This process, and with it all that it starts from now on."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def warm(job: RaceJob) -> tuple[EvaluationOutcome, float]:
    """One evaluation with processes that waited for it, and the processor seconds that it took in all of them."""
    pool = ProcessPool(venues=[job.venue])
    time.sleep(READY_S)
    while any(process.wants_processor() for process in (pool.runner, *(each.process for each in pool.policies))):
        time.sleep(READY_S)
    clock = Clock()
    clock.look()  # a walk through /proc, and what the processes took to get ready: neither belongs to the evaluation
    before_s = clock.seconds
    try:
        outcome = evaluate(job, on_progress=clock.look, pool=pool)  # the last progress comes at the very end
    finally:
        clock.close()
    return outcome, clock.seconds - before_s


def _runs(job: RaceJob, runs: int) -> list[dict[str, Any]]:
    pin_to_one_core()
    # The first reads every library from disk; it is driven, but does not count.
    return [_one(job) for _ in range(runs + 1)][1:]


def _one(job: RaceJob) -> dict[str, Any]:
    cold = evaluate(job)
    outcome, cpu_s = warm(job)
    return _figures(outcome, cold, cpu_s)


def _figures(outcome: EvaluationOutcome, cold: EvaluationOutcome, cpu_s: float) -> dict[str, Any]:
    simulated_s = outcome.simulated_ms / 1000.0
    seconds = outcome.shares
    parts = {
        "physics": seconds["physics"],
        "network": seconds["network"],
        "camera": seconds["camera"],
        "pipes": seconds["policy"] - seconds["network"],
        "start": seconds["start"],
        "other": seconds["other"],
    }
    own_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE
    return {
        "real_time_factor": simulated_s / outcome.wall_s,
        "cold_factor": simulated_s / cold.wall_s,
        "driving_factor": simulated_s / (outcome.wall_s - seconds["start"]),
        "cpu_factor": simulated_s / cpu_s,
        "wall_s": outcome.wall_s,
        "cpu_s": cpu_s,
        "startup_s": cold.shares["start"],
        "simulated_s": simulated_s,
        "us_per_step": 1e6 * (outcome.wall_s - seconds["start"]) / outcome.steps,
        "resets": sum(lap["resets"] for lap in outcome.laps),
        "shares": {name: value / outcome.wall_s for name, value in parts.items()},
        "bullet_and_network": sum(parts[name] for name in IN_BULLET_AND_NETWORK) / outcome.wall_s,
        "peak_mb": own_mb + outcome.peak_mb,
        "peak_mb_sandboxed": outcome.peak_mb,
    }


def _median(values: list[Any]) -> Any:
    if isinstance(values[0], dict):
        return {key: _median([value[key] for value in values]) for key in values[0]}
    return statistics.median(values)
