"""A process that drives one reference lap: a track's document on standard input, the run as JSON on standard output.

``null``: the driver cannot stay on the road.
"""

import json
import os
import resource
import sys
from typing import TypedDict

from paddock.analysis.reference_lap import drive_reference
from paddock.geometry.track import TrackGeometry
from paddock.simulator.results import LapDocument

CPU_LIMIT_S = 600


class DrivenReference(TypedDict):
    """The run on standard output."""

    time_ms: int
    laps: list[LapDocument]
    trace: str  # CSV
    trace_sha256: str
    style: dict[str, float]
    runs: int


def main() -> None:
    """Drive it at the lowest priority, within a limit of processor time."""
    os.nice(19)
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT_S, CPU_LIMIT_S))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # Bullet greets on standard output
    asked = json.load(sys.stdin)
    found = drive_reference(TrackGeometry.from_trusted_dict(asked["track"]), asked["direction"])
    document: DrivenReference | None = (
        None
        if found is None
        else {
            "time_ms": found.time_ms,
            "laps": [lap.to_dict() for lap in found.result.laps],
            "trace": found.result.trace.to_csv().decode(),
            "trace_sha256": found.result.trace.sha256,
            "style": vars(found.style),
            "runs": found.runs,
        }
    )
    with answers:
        json.dump(document, answers)


if __name__ == "__main__":
    main()
