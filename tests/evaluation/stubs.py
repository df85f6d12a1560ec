"""A pipeline without a simulator: outcomes and runs whose content the test chooses."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from evaluation.running.pipeline import CompetitorOutcome, EvaluationOutcome, RaceJob
from paddock.simulator import engine

HEADER = (
    "episode,steps,X,Y,yaw,steer,throttle,action,reward,done,all_wheels_on_track,progress,closest_waypoint,track_len,"
    "tstamp,episode_status,pause_duration,obstacle_crash_counter,wall_clock"
)


def trace_csv(laps: int = 2, steps: int = 5, salt: int = 0) -> bytes:
    """A sim-trace of ``laps`` laps of ``steps`` rows each."""
    rows = [
        f"{lap},{step},{step * 0.5 + salt},{lap * 1.0},0.0,0.0,1.5,1,0.0,False,True,1.0,1,20.0,{step / 15},"
        "in_progress,0.0,0,0.0"
        for lap in range(laps)
        for step in range(1, steps + 1)
    ]
    return "\n".join([HEADER, *rows, ""]).encode()


def outcome_of(
    salt: int = 0,
    laps: tuple[int, ...] = (10_000, 9_500),
    unfinished: bool = False,
    rivals: Sequence[CompetitorOutcome] = (),
    **more: Any,
) -> EvaluationOutcome:
    """An outcome with these lap times in milliseconds; with ``unfinished`` the last lap is not complete."""
    car = car_outcome(salt, laps, unfinished)
    return EvaluationOutcome(
        **{field.name: getattr(car, field.name) for field in fields(car)} | {"order": [*range(len(rivals) + 1)]} | more,
        rivals=list(rivals),
        simulated_ms=sum(laps),
        steps=100,
        engine=engine.ENGINE_ID,
        versions={"numpy": "2.4"},
        cpu_model="test",
        wall_s=0.5,
        shares={},
        peak_mb=100.0,
    )


def car_outcome(
    salt: int = 0, laps: tuple[int, ...] = (10_000, 9_500), unfinished: bool = False, retired: str = ""
) -> CompetitorOutcome:
    """One car's part, as in :func:`outcome_of`. ``retired``: the code of the fault that took it off the track."""
    trace = trace_csv(len(laps), salt=salt)
    driven = [
        _lap(number, time_ms, complete=number < len(laps) or not (unfinished or retired))
        for number, time_ms in enumerate(laps, 1)
    ]
    return CompetitorOutcome(
        laps=driven,
        end_reason="retired" if retired else "time_up" if unfinished else "laps_done",
        retired={"code": retired, "params": {"step": 50, "how": "SIGSEGV"}} if retired else None,
        trace_csv=trace,
        trace_sha256=hashlib.sha256(trace).hexdigest(),
        metrics={"metrics": []},
    )


def _lap(number: int, time_ms: int, complete: bool) -> dict[str, Any]:
    return {
        "number": number,
        "start_ms": 0,
        "time_ms": time_ms,
        "complete": complete,
        "off_tracks": 1,
        "crashes": 0,
        "resets": 1,
        "immobilised": 0,
        "reversals": 0,
        "sector_ms": [time_ms // 3] * 3,
        "completion_percentage": 100 if complete else 40,
        "status": "Lap complete" if complete else "Time Up",
    }


def finishes(job: RaceJob, on_progress=None, should_stop=None, wall_limit_s=0.0, pool=None) -> EvaluationOutcome:
    """A run that ends at once, with an outcome that the job's seed decides."""
    return outcome_of(salt=job.rules.seed)
