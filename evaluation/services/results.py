"""From what the pipeline measured to the row and the file that are kept."""

from __future__ import annotations

import csv
import gzip
import io
import logging
import uuid
from datetime import datetime
from typing import TYPE_CHECKING

from django.core.files.base import ContentFile
from django.core.files.storage import Storage

from faults import PlatformFault

from ..models import Evaluation, Result

if TYPE_CHECKING:
    from ..pipeline import EvaluationOutcome

logger = logging.getLogger(__name__)
POINTS_PER_LAP = 240


def result_of(evaluation_id: int, lease: uuid.UUID, outcome: EvaluationOutcome, trace: str, now: datetime) -> Result:
    """The unsaved row for an outcome whose trace is stored as ``trace``."""
    complete = [lap["time_ms"] for lap in outcome.laps if lap["complete"]]
    return Result(
        evaluation_id=evaluation_id,
        lease=lease,
        laps=outcome.laps,
        line=driven_line(outcome.trace_csv),
        end_reason=outcome.end_reason,
        complete_laps=len(complete),
        best_lap_ms=min(complete, default=None),
        total_ms=sum(lap["time_ms"] for lap in outcome.laps),
        off_tracks=sum(lap["off_tracks"] for lap in outcome.laps),
        crashes=sum(lap["crashes"] for lap in outcome.laps),
        resets=sum(lap["resets"] for lap in outcome.laps),
        simulated_ms=outcome.simulated_ms,
        wall_s=outcome.wall_s,
        peak_mb=outcome.peak_mb,
        trace=trace,
        trace_sha256=outcome.trace_sha256,
        metrics=outcome.metrics,
        engine=outcome.engine,
        versions=outcome.versions,
        cpu_model=outcome.cpu_model[:128],
        created_at=now,
    )


def driven_line(trace_csv: bytes) -> list[list[list[float]]]:
    """For each lap at most :data:`POINTS_PER_LAP` evenly chosen ``[x, y, speed]`` (metres, m/s), from a sim-trace.

    Rows in which the car stands out a penalty are left out.
    """
    laps: dict[str, list[list[float]]] = {}
    for row in csv.DictReader(io.StringIO(trace_csv.decode())):
        if row["episode_status"] == "pause":
            continue
        point = [round(float(row["X"]), 3), round(float(row["Y"]), 3), round(float(row["throttle"]), 2)]
        laps.setdefault(row["episode"], []).append(point)
    return [_thinned(points) for points in laps.values()]


def _thinned(points: list[list[float]]) -> list[list[float]]:
    """Every n-th point, and always the first and the last."""
    step = -(-len(points) // POINTS_PER_LAP)
    chosen = points[::step]
    if chosen and chosen[-1] is not points[-1]:
        chosen[-1:] = [points[-1]] if len(chosen) == POINTS_PER_LAP else [chosen[-1], points[-1]]
    return chosen


def trace_name(evaluation: Evaluation) -> str:
    """The name of the trace's file: this evaluation's, this attempt's, this lease's alone."""
    return f"traces/{evaluation.public_id}-{evaluation.attempt}-{evaluation.lease}.csv.gz"


def store_trace(evaluation: Evaluation, trace_csv: bytes) -> str:
    """Store a trace, gzipped. Raises PlatformFault("storage_failed")."""
    packed = gzip.compress(trace_csv, compresslevel=6, mtime=0)
    try:
        return _storage().save(trace_name(evaluation), ContentFile(packed))
    except OSError as error:
        raise PlatformFault("storage_failed") from error


def read_trace(result: Result) -> bytes:
    """A result's sim-trace as CSV. Raises PlatformFault("storage_failed")."""
    try:
        with _storage().open(result.trace.name) as file:
            return gzip.decompress(file.read())
    except OSError as error:
        raise PlatformFault("storage_failed") from error


def delete_trace(name: str) -> None:
    """Delete a trace that no result refers to. One that cannot be deleted now is logged and left."""
    try:
        # a commit whose answer got lost may have gone through all the same
        if not Result.objects.filter(trace=name).exists():
            _storage().delete(name)
    except Exception:
        logger.exception("The unused trace %s could not be deleted.", name)


def _storage() -> Storage:
    return Result._meta.get_field("trace").storage
