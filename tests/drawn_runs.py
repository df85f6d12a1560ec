"""Runs that were driven, to be drawn in tests: short ones, on the oval."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from races.entries.services.submissions import submit_model
from races.models import Race
from tests.evaluation.stubs import HEADER
from tests.factories import a_model, laps, outcome, start
from tracks.models import Track
from videos.drawing import VideoFacts, VideoScene

LAP_MS = 1_000


def driven_trace(track: Track, laps: int = 2, lap_ms: int = LAP_MS) -> bytes:
    """A sim-trace of a car that drives along the centre line, a row for each fifteenth of a second."""
    geometry, rows = track.geometry, [HEADER]
    steps = round(lap_ms / 1000 * 15)
    for lap in range(laps):
        for step in range(steps):
            x, y, yaw = geometry.point_at(geometry.length * step / steps)
            time = lap * lap_ms / 1000 + step / 15
            rows.append(
                f"{lap},{step + 1},{x:.4f},{y:.4f},{math.degrees(yaw):.2f},0.0,1.5,1,0.0,False,True,"
                f"{100 * step / steps:.2f},1,{geometry.length:.2f},{time:.4f},in_progress,0.0,0,{time:.4f}"
            )
    return "\n".join([*rows, ""]).encode()


def a_drawing(scene: VideoScene, out: Path, *, on_progress=None, is_stopped=None) -> VideoFacts:
    """Instead of drawing, where a test is about the queue: a file that says what the scene shows."""
    content = f"{scene.title} {scene.followed} {scene.lap} {[car.name for car in scene.cars]}".encode()
    out.write_bytes(content)
    return VideoFacts(frames=30, duration_ms=1000, width=1280, height=720, size=len(content))


def a_driven_run(race: Race, racer: Any, now: datetime, *, lap_ms: int = LAP_MS, count: int = 3) -> Evaluation:
    """A finished run of ``count`` laps that really went round the track, in ``race``; the second lap is the fastest."""
    submission = submit_model(race=race, racer=racer, model=a_model(racer), now=now)
    evaluation = start(submission.evaluation, now)
    times = [lap_ms - (number == 2) for number in range(1, count + 1)]
    driven = outcome(laps(*times))
    for number, lap in enumerate(driven.laps):
        lap["start_ms"] = sum(times[:number])
    driven = replace(driven, trace_csv=driven_trace(race.track, count, lap_ms))
    assert finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=driven, now=now)
    evaluation.refresh_from_db()
    return evaluation
