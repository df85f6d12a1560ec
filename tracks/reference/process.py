"""A process that drives one reference lap: a track's document on standard input, the run as JSON on standard output.

``null``: the driver cannot stay on the road.
"""

import json
import os
import resource
import sys

from paddock.analysis.reference_lap import drive_reference
from paddock.geometry.track import TrackGeometry

CPU_LIMIT_S = 600


def main() -> None:
    """Drive it at the lowest priority, within a limit of processor time."""
    os.nice(19)
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT_S, CPU_LIMIT_S))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # Bullet greets on standard output
    asked = json.load(sys.stdin)
    found = drive_reference(TrackGeometry.from_trusted_dict(asked["track"]), asked["direction"])
    document = found and {
        "time_ms": found.time_ms,
        "laps": [lap.to_dict() for lap in found.result.laps],
        "trace": found.result.trace.to_csv().decode(),
        "trace_sha256": found.result.trace.sha256,
        "style": vars(found.style),
        "runs": found.runs,
    }
    with answers:
        json.dump(document, answers)


if __name__ == "__main__":
    main()
