"""What boxes and bots cost: the same car alone, among six boxes and among four bots, one after the other in turns.

All three drive the same simulated time without penalties: a car that stands one out costs next to nothing, and crashes
would make a race look fast.
"""

from __future__ import annotations

import multiprocessing
import statistics
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from evaluation.running.pipeline import RaceJob
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import HEAD_TO_HEAD, OBJECT_AVOIDANCE, TIME_TRIAL, RaceRules

from . import whole
from .models import AdmittedCar

BOXES, BOTS = 6, 4
KINDS: dict[str, dict[str, Any]] = {
    TIME_TRIAL: {},
    OBJECT_AVOIDANCE: {"random_boxes": BOXES},
    HEAD_TO_HEAD: {"bots": BOTS, "bot_speed_mps": 1.0, "bot_lane_changes": True},
}
SIMULATED_MS_A_LAP = 20_000
_ENDLESS_LAPS = 1000


def compare(car: AdmittedCar, track: TrackGeometry, *, laps: int, runs: int) -> dict[str, Any]:
    """For each kind of race the medians of ``runs`` evaluations: real-time factor by wall and by processor time,
    microseconds a control step, crashes, and the share of the time trial's factor (``ratio``, median of the turns)."""
    jobs = {
        kind: RaceJob(
            track,
            RaceRules(
                race_type=kind,
                laps=_ENDLESS_LAPS,
                max_simulated_ms=laps * SIMULATED_MS_A_LAP,
                off_track_penalty_ms=0,
                collision_penalty_ms=0,
                **options,
            ),
            car.onnx,
            car.metadata,
            facts=car.facts,
        )
        for kind, options in KINDS.items()
    }
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        turns = pool.submit(_turns, jobs, runs).result()
    return {
        "model": car.name,
        **{
            kind: {
                key: statistics.median(
                    turn[kind][key] if key != "ratio" else turn[kind]["cpu_factor"] / turn[TIME_TRIAL]["cpu_factor"]
                    for turn in turns
                )
                for key in (*turns[0][kind], "ratio")
            }
            for kind in KINDS
        },
    }


def _turns(jobs: dict[str, RaceJob], runs: int) -> list[dict[str, dict[str, float]]]:
    whole.pin_to_one_core()
    return [{kind: _figures(job) for kind, job in jobs.items()} for _ in range(runs + 1)][1:]


def _figures(job: RaceJob) -> dict[str, float]:
    outcome, cpu_s = whole.warm(job)
    simulated_s = outcome.simulated_ms / 1000.0
    return {
        "real_time_factor": simulated_s / outcome.wall_s,
        "cpu_factor": simulated_s / cpu_s,
        "us_per_step": 1e6 * (outcome.wall_s - outcome.shares["start"]) / outcome.steps,
        "camera_us": 1e6 * outcome.shares["camera"] / outcome.steps,
        "crashes": sum(lap["crashes"] for lap in outcome.laps),
    }
