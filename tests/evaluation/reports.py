"""Reports that a test asks for, and chunks that are driven without a simulator."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from datetime import datetime
from typing import Any

from evaluation.models.reports import CarReport, ReportChunk, ReportLap
from evaluation.reports.jobs import CHUNKS, finish_chunk
from evaluation.reports.services import request_report
from evaluation.running.drives import DriveOutcome, DrivesOutcome
from paddock.simulator.engine import ENGINE_ID
from tests.factories import a_model, a_track

Came = Callable[[ReportLap], dict[str, Any]]


def a_report(owner: Any, now: datetime, **options: Any) -> CarReport:
    """One on the oval: a lap in each direction and the variations, unless ``options`` say otherwise."""
    usual: dict[str, Any] = {"track_set": "chosen", "tracks": [a_track()], "variations_on": a_track()}
    model = options.pop("model", None) or a_model(owner)
    return request_report(owner=owner, model=model, now=now, **usual | options)


def came_round(lap: ReportLap) -> dict[str, Any]:
    """Every lap is completed in about nine seconds."""
    return {}


def outcome_of(chunk: ReportChunk, came: Came = came_round, engine: str = ENGINE_ID) -> DrivesOutcome:
    """What a worker comes back with."""
    drives = []
    for lap in chunk.laps.order_by("number"):
        said = {"complete": True, "time_ms": 9000 + lap.number, "percent": 100.0, "status": "Lap complete"} | came(lap)
        digest = hashlib.sha256(f"{lap.number} {said}".encode()).hexdigest()
        drives.append(
            DriveOutcome(number=lap.number, end_reason="laps_done", x=1.0, y=2.0, trace_sha256=digest, **said)
        )
    return DrivesOutcome(drives, engine, {}, inexact=False, wall_s=0.1)


def drive(report: CarReport, now: datetime, came: Came = came_round, **more: Any) -> CarReport:
    """Let workers drive all of it."""
    while report.state in ("queued", "running"):
        waiting = report.chunks.filter(state="queued").order_by("number").first()
        assert waiting is not None
        chunk = CHUNKS.take(waiting.pk, waiting.attempt, worker="w", now=now)
        assert chunk is not None and chunk.lease is not None
        assert finish_chunk(pk=chunk.pk, lease=chunk.lease, outcome=outcome_of(chunk, came, **more), now=now)
        report.refresh_from_db()
    return report


def off_the_road(*numbers: int) -> Came:
    """These variations are not completed."""

    def came(lap: ReportLap) -> dict[str, Any]:
        if lap.variation not in numbers:
            return {}
        return {"complete": False, "time_ms": 3000, "percent": 31.5, "status": "Off track"}

    return came
