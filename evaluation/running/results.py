"""From what the pipeline measured to the rows and the files that are kept."""

from __future__ import annotations

import csv
import gzip
import io
import json
import logging
import uuid
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from django.db import transaction
from django.db.models import Q

from core.database.after_commit import after_commit
from core.files.storage_faults import storage_at_work
from paddock.rules.race import MAX_CARS
from paddock.simulator.layout import LayoutDocument

from ..models import CompetitorResult, Evaluation, Result, RivalResult
from ..stored_files import delete, read_gzip, store

if TYPE_CHECKING:
    from .pipeline import CompetitorOutcome, EvaluationOutcome

logger = logging.getLogger(__name__)
POINTS_PER_LAP = 240


@dataclass(frozen=True)
class RunFiles:
    """Names of the stored files of a run: the traces of all cars, car 0 first, and the bot cars' poses (or ``""``)."""

    traces: list[str]
    bots: str = ""

    def delete(self) -> None:
        delete_files([*self.traces, self.bots] if self.bots else self.traces)


def write_result(
    evaluation_id: int, lease: uuid.UUID, outcome: EvaluationOutcome, files: RunFiles, now: datetime
) -> Result:
    """Write the rows of an outcome whose files are stored. Call it in a transaction."""
    result = Result(
        evaluation_id=evaluation_id,
        lease=lease,
        order=outcome.order,
        layout={"boxes": outcome.layout.get("boxes", [])},
        bots=files.bots,
        simulated_ms=outcome.simulated_ms,
        wall_s=outcome.wall_s,
        peak_mb=outcome.peak_mb,
        engine=outcome.engine,
        versions=outcome.versions,
        cpu_model=outcome.cpu_model[:128],
        created_at=now,
        **_car_columns(outcome, files.traces[0]),
    )
    result.save(force_insert=True)
    RivalResult.objects.bulk_create(
        RivalResult(result=result, number=number, **_car_columns(car, files.traces[number]))
        for number, car in enumerate(outcome.rivals, 1)
    )
    return result


def _car_columns(car: EvaluationOutcome | CompetitorOutcome, trace: str) -> dict[str, Any]:
    complete = [lap["time_ms"] for lap in car.laps if lap["complete"]]
    retired = car.retired or {"code": "", "params": {}}
    return {
        "laps": car.laps,
        "trajectory": trajectory_of(car.trace_csv),
        "end_reason": car.end_reason,
        "retired_code": retired["code"],
        "retired_params": retired["params"],
        "complete_laps": len(complete),
        "best_lap_ms": min(complete, default=None),
        "total_ms": sum(lap["time_ms"] for lap in car.laps),
        "off_tracks": sum(lap["off_tracks"] for lap in car.laps),
        "crashes": sum(lap["crashes"] for lap in car.laps),
        "resets": sum(lap["resets"] for lap in car.laps),
        "trace": trace,
        "trace_sha256": car.trace_sha256,
        "metrics": car.metrics,
    }


def trajectory_of(trace_csv: bytes) -> list[list[list[float]]]:
    """For each lap at most :data:`POINTS_PER_LAP` evenly chosen ``[x, y, speed]`` (metres, m/s) from a sim-trace,
    without the rows of penalties."""
    laps: dict[str, list[list[float]]] = {}
    for row in csv.DictReader(io.StringIO(trace_csv.decode())):
        if row["episode_status"] == "pause":
            continue
        point = [round(float(row["X"]), 3), round(float(row["Y"]), 3), round(float(row["throttle"]), 2)]
        laps.setdefault(row["episode"], []).append(point)
    return [_thinned(points) for points in laps.values()]


def _thinned(points: list[list[float]]) -> list[list[float]]:
    step = -(-len(points) // POINTS_PER_LAP)
    chosen = points[::step]
    if chosen and chosen[-1] is not points[-1]:
        chosen[-1:] = [points[-1]] if len(chosen) == POINTS_PER_LAP else [chosen[-1], points[-1]]
    return chosen


def file_names(evaluation: Evaluation) -> list[str]:
    """The names of an evaluation's files with this attempt and lease: car 0's trace, the rivals', bots."""
    stem = f"traces/{evaluation.public_id}-{evaluation.attempt}-{evaluation.lease}"
    rivals = [f"{stem}-{number}.csv.gz" for number in range(1, MAX_CARS)]
    return [f"{stem}.csv.gz", *rivals, f"{stem}-bots.json.gz"]


def store_files(evaluation: Evaluation, outcome: EvaluationOutcome) -> RunFiles:
    """Store the traces and the bot cars' poses, gzipped; all or none. Raises PlatformFault("storage_failed")."""
    *trace_names, bots_name = file_names(evaluation)
    traces = [outcome.trace_csv, *(car.trace_csv for car in outcome.rivals)]
    contents = dict(zip(trace_names, traces, strict=False))
    if bots := outcome.layout.get("bots"):
        contents[bots_name] = json.dumps(bots, separators=(",", ":")).encode()
    stored: list[str] = []
    with ExitStack() as unless_all:
        unless_all.callback(delete_files, stored)
        for name, content in contents.items():
            packed = gzip.compress(content, compresslevel=6, mtime=0)
            with storage_at_work():
                stored.append(store(name, packed))
        unless_all.pop_all()
    return RunFiles(stored[: len(traces)], stored[-1] if bots else "")


def read_trace(result: CompetitorResult) -> bytes:
    """A car's sim-trace as CSV. Raises PlatformFault("storage_failed"), ("file_damaged")."""
    return read_gzip(result.trace.name or "")


def read_layout(result: Result) -> LayoutDocument:
    """``{"boxes": [{"fraction", "lane", "x", "y", "yaw"}], "bots": [[[x, y, yaw], ... a row of car 0's trace], ... a
    bot]}`` in metres and radians. Raises PlatformFault ``storage_failed``, ``file_damaged``."""
    bots = json.loads(read_gzip(result.bots.name or "")) if result.bots else []
    return {"boxes": result.layout.get("boxes", []), "bots": bots}


@transaction.atomic
def delete_evaluation(*, evaluation: Evaluation) -> None:
    """Delete a finished run with its result, videos and, after the commit, files. Raises ProtectedError for one that
    belongs to a race."""
    result = Result.with_sealed.filter(evaluation=evaluation).first()
    names: list[str] = []
    if result is not None:
        names = [result.trace.name or "", result.bots.name or ""]
        names += [rival.trace.name or "" for rival in result.rivals.all()]
    evaluation.delete()
    after_commit(delete_files, [name for name in names if name])


def files_of_runs(runs: Any) -> list[str]:
    """The names of the files of these runs, by ids or a query of them."""
    results = Result.with_sealed.filter(evaluation__in=runs).values_list("trace", "bots")
    rivals = RivalResult.objects.filter(result__evaluation__in=runs).values_list("trace")
    return [name for names in (*results, *rivals) for name in names if name]


def delete_files(names: list[str]) -> None:
    """Delete those files that no result refers to. What cannot be deleted now is logged and left."""
    for name in names:
        try:
            # a commit whose answer got lost may have gone through all the same
            of_result = Result.with_sealed.filter(Q(trace=name) | Q(bots=name)).exists()
            if not of_result and not RivalResult.objects.filter(trace=name).exists():
                delete(name)
        except Exception:
            logger.exception("The unused file %s could not be deleted.", name)
