"""References that were driven, as rows."""

from __future__ import annotations

import gzip
from datetime import datetime

from paddock.simulator.engine import ENGINE_ID
from tests.drawn_runs import driven_trace
from tests.factories import laps
from tracks.models import ReferenceLap, ReferenceState, Track


def a_reference(track: Track, time_ms: int, now: datetime, direction: str = "ccw", **fields) -> ReferenceLap:
    """A finished reference of three laps, of which the second is the best."""
    driven = laps(time_ms + 200, time_ms, time_ms + 100)
    for number, lap in enumerate(driven):
        lap["start_ms"] = sum(each["time_ms"] for each in driven[:number])
    return ReferenceLap.objects.create(
        **{"track": track, "direction": direction, "engine": ENGINE_ID, "state": ReferenceState.FINISHED}
        | {"queued_at": now, "ended_at": now, "time_ms": time_ms, "laps": driven, "trace_sha256": "a" * 64}
        | {"trace": gzip.compress(driven_trace(track, 3, time_ms))}
        | fields
    )
