"""The process that drives at home: it reads a job and writes lines of JSON."""

# ``python -m paddock.cli.child JOB FOLDER``, started with the pins of :mod:`paddock.exact`. JOB is a file with a
# :class:`HomeJob`. The process writes ``{"progress": {...}}`` at times, and at the end ``{"result": HomeResult}`` or
# ``{"error": {"code", "fault", "params"}}``. The trace of car N is written to ``FOLDER/N.csv``.

from __future__ import annotations

import contextlib
import gc
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypedDict

from paddock.errors import PaddockError, UserFault
from paddock.exact import is_pinned
from paddock.short_lived import leave

from .files import UNREADABLE, file_faults

if TYPE_CHECKING:
    from paddock.geometry.track import TrackDocument
    from paddock.packages.own import OwnCar
    from paddock.simulator.results import CompetitorRun, Fault, LapDocument, ProgressDocument


class JobCar(TypedDict):
    """A car by its files; ``checkpoint``: of a training's folder."""

    files: list[str]
    checkpoint: str


class HomeJob(TypedDict, total=False):
    """A run: its track as its ``to_dict`` writes it or its slug in the catalogue, its rules as their ``to_dict`` writes
    them, and either its ``cars`` or ``traces``, which are files of sim-traces (CSV) with commands to drive again
    without a network."""

    track: TrackDocument | str
    look: str
    rules: Mapping[str, object]
    cars: list[JobCar]
    traces: list[str]


class HomeCar(TypedDict):
    """The result of one car. ``sha256``: of its model, empty for a trace."""

    sha256: str
    laps: list[LapDocument]
    end_reason: str
    retired: Fault | None
    simulated_ms: int
    trace_sha256: str
    metrics: Any


class DrivenTrack(TypedDict):
    name: str
    length_m: float
    direction: str


class HomeResult(TypedDict):
    """The result of a run at home. ``exact``: the process was started with the pins."""

    track: DrivenTrack
    engine: str
    versions: dict[str, str]
    exact: bool
    order: list[int]
    cars: list[HomeCar]


class HomeMessage(TypedDict, total=False):
    """A line of the process: its progress, and at the end its result or error."""

    progress: ProgressDocument
    result: HomeResult
    error: Mapping[str, object]


def main(job: str, folder: str) -> int:
    gc.set_threshold(100_000)  # what the imports make stays, and searching it takes a tenth of their time
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as out:
        os.dup2(2, 1)  # libraries greet on standard output
        message: HomeMessage
        try:
            message = {"result": _driven(json.loads(Path(job).read_text(encoding="utf-8")), Path(folder), out)}
        except PaddockError as fault:
            message = {"error": fault.to_dict()}
        _write_line(out, message)
    return 0


def _write_line(out: TextIO, message: HomeMessage) -> None:
    print(json.dumps(message), file=out, flush=True)


def _driven(job: HomeJob, folder: Path, out: TextIO) -> HomeResult:
    import cv2

    from paddock.geometry.catalogue import by_slug
    from paddock.geometry.track import TrackGeometry
    from paddock.rules.race import RaceRules
    from paddock.simulator import compiled

    if compiled.library() is None:
        with contextlib.suppress(OSError, RuntimeError):  # without it frames are drawn slowly, and are the same
            compiled.build()
        compiled.library.cache_clear()
    from paddock.simulator.own import drive, drive_again  # which loads it
    from paddock.simulator.results import metrics_json

    cv2.setNumThreads(1)
    rules = RaceRules.from_dict(job["rules"])
    if isinstance(job["track"], str):
        track = by_slug(job["track"]).geometry(rules.direction)
    else:
        track = TrackGeometry.from_dict(job["track"])
    if "traces" in job:
        try:
            result = drive_again(track, rules, [Path(name).read_bytes() for name in job["traces"]])
        except ValueError as error:
            raise UserFault("trace_strange", problem=str(error)) from error
        identities = [""] * len(job["traces"])
    else:
        cars = [_read(one) for one in job["cars"]]
        identities = [car.sha256 for car in cars]
        result = drive(
            track, rules, cars, job["look"], lambda one: _write_line(out, {"progress": one.to_dict()})
        ).result
    driven: list[CompetitorRun] = [result, *result.rivals]
    for number, car in enumerate(driven):
        (folder / f"{number}.csv").write_bytes(car.trace.to_csv())
    return {
        "track": {"name": track.name, "length_m": track.length, "direction": track.direction},
        "engine": result.engine,
        "versions": result.versions,
        "exact": is_pinned(),
        "order": result.order,
        "cars": [
            {
                "sha256": identity,
                "laps": [lap.to_dict() for lap in car.laps],
                "end_reason": car.end_reason,
                "retired": car.retired,
                "simulated_ms": car.simulated_ms,
                "trace_sha256": car.trace.sha256,
                "metrics": metrics_json(car)["metrics"],
            }
            for identity, car in zip(identities, driven, strict=True)
        ],
    }


def _read(car: JobCar) -> OwnCar:
    from paddock.packages.own import read_car

    with file_faults(UNREADABLE):
        return read_car([Path(name) for name in car["files"]], car["checkpoint"])


if __name__ == "__main__":
    leave(main(*sys.argv[1:]))
