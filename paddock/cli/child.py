"""The process that drives at home: a job in, lines of JSON out. It is started with the pins of :mod:`paddock.exact`.

``python -m paddock.cli.child JOB FOLDER``. JOB is a file: ``{"track", "look", "rules", "cars"}``, a car being
``{"files", "checkpoint"}``; or with ``traces`` in place of ``cars`` the sim-traces (CSV) whose commands are driven
again without a network. It says ``{"progress": {...}}`` now and then and at the end ``{"result": {...}}`` or
``{"error": {"code", "fault", "params"}}``.
The trace of car N is written to ``FOLDER/N.csv``.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from paddock.errors import PaddockError, UserFault
from paddock.exact import is_pinned

if TYPE_CHECKING:
    from paddock.packages.own import OwnCar
    from paddock.simulator.race import CompetitorRun, RaceResult


def main(job: str, folder: str) -> int:
    """Drive; see the module."""
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as out:
        os.dup2(2, 1)  # libraries greet on standard output
        try:
            said = {"result": _driven(json.loads(Path(job).read_text(encoding="utf-8")), Path(folder), out)}
        except PaddockError as fault:
            said = {"error": fault.to_dict()}
        _say(out, said)
    return 0


def _say(out: TextIO, said: Mapping[str, Any]) -> None:
    print(json.dumps(said), file=out, flush=True)


def _driven(job: dict[str, Any], folder: Path, out: TextIO) -> dict[str, Any]:
    import cv2

    from paddock.geometry.track import TrackGeometry
    from paddock.rules.race import RaceRules
    from paddock.simulator import compiled
    from paddock.simulator.metrics import metrics_json
    from paddock.simulator.own import drive, drive_again

    cv2.setNumThreads(1)
    if compiled.load() is None:
        with contextlib.suppress(OSError, RuntimeError):  # without it frames are drawn slowly, and are the same
            compiled.build()
    track = TrackGeometry.from_dict(job["track"])
    rules = RaceRules.from_dict(job["rules"])
    if "traces" in job:
        try:
            result = drive_again(track, rules, [Path(name).read_bytes() for name in job["traces"]])
        except ValueError as error:
            raise UserFault("trace_strange", problem=str(error)) from error
        identities = [""] * len(job["traces"])
    else:
        cars = [_read(one) for one in job["cars"]]
        identities = [car.sha256 for car in cars]
        result = drive(track, rules, cars, job["look"], lambda told: _say(out, {"progress": told.to_dict()})).result
    driven: list[RaceResult | CompetitorRun] = [result, *result.rivals]
    for number, car in enumerate(driven):
        (folder / f"{number}.csv").write_bytes(car.trace.to_csv())
    return {
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


def _read(car: dict[str, Any]) -> OwnCar:
    from paddock.packages.own import read_car

    try:
        return read_car([Path(name) for name in car["files"]], car["checkpoint"])
    except OSError as error:
        problem = error.strerror or str(error)
        raise UserFault("home_file_unreadable", path=str(error.filename), problem=problem) from error


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
