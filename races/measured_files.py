"""The measured laps of a race as CSV, which :mod:`races.services.timing.files` reads again."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from typing import TYPE_CHECKING

from core.times import clock

from .exports import Echo, plain
from .measured import counted_ms, is_complete
from .selectors.timing import sessions_of

if TYPE_CHECKING:
    from .models import MeasuredLap, Race, TimedSession

HEADING = (
    *("session", "started_at", "racer", "guest", "car", "model", "source", "lap", "time", "time_ms"),
    *("off_tracks", "resets", "valid", "counted_ms", "note", "corrected"),
)


def lap_lines(race: Race) -> Iterator[str]:
    """Every lap, line by line, a heading first. ``counted_ms``: with penalties; empty for a lap that does not count."""
    writer = csv.writer(Echo(), lineterminator="\r\n")
    yield writer.writerow(HEADING)
    for session in sessions_of(race):
        for lap in session.laps.all():
            yield writer.writerow([plain(cell) for cell in _cells(race, session, lap)])


def _cells(race: Race, session: TimedSession, lap: MeasuredLap) -> tuple:
    entry = session.entry
    return (
        session.pk,
        session.started_at.isoformat(),
        "" if entry.guest_name else entry.racer.alias,
        entry.guest_name,
        session.car,
        session.model.name if session.model else "",
        session.source,
        lap.number,
        clock(lap.time_ms),
        lap.time_ms,
        lap.off_tracks,
        lap.resets,
        int(lap.valid),
        counted_ms(race, lap) if is_complete(race, lap) else "",
        lap.note,
        int(lap.corrected),
    )
