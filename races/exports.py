"""A board as plain data, for the CSV and JSON links and for whoever else hands boards to programs."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from datetime import datetime
from typing import TYPE_CHECKING, Any

from paddock.rules.race import RANKING

from .selectors import BoardRow, whole_board

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

    from .models import Race

COLUMNS = (
    "rank",
    "racer",
    "country",
    "baseline",
    "classified",
    "score_ms",
    "gap_ms",
    "average_ms",
    "best_lap_ms",
    "total_ms",
    "complete_laps",
    "sector_1_ms",
    "sector_2_ms",
    "sector_3_ms",
    "off_tracks",
    "resets",
    "submissions",
    "submitted_at",
    "seed",
    "points",
    "duels",
    "duel_lap_ms",
    "guest",
)


def row_data(row: BoardRow) -> dict[str, Any]:
    """One row of a board with the keys of :data:`COLUMNS`: times in whole milliseconds, None where there is none."""
    entry = row.entry
    sectors = [*entry.sectors, None, None, None][:3]
    return {
        "rank": row.rank,
        "racer": row.alias,
        "country": row.racer.country,
        "baseline": row.is_baseline,
        "classified": row.classified,
        "score_ms": entry.score_ms,
        "gap_ms": row.gap_ms,
        "average_ms": entry.average_ms,
        "best_lap_ms": entry.best_lap_ms,
        "total_ms": entry.total_ms,
        "complete_laps": entry.complete_laps,
        **{f"sector_{number}_ms": time for number, time in enumerate(sectors, start=1)},
        "off_tracks": entry.off_tracks,
        "resets": entry.resets,
        "submissions": entry.submission_count,
        "submitted_at": None if entry.achieved_at is None else entry.achieved_at.isoformat(),
        "seed": entry.seed,
        "points": None if entry.seed is None else entry.points,
        "duels": None if entry.seed is None else entry.duels,
        "duel_lap_ms": entry.duel_lap_ms,
        "guest": bool(entry.guest_name),
    }


def board_data(race: Race, now: datetime, racer: Racer | AnonymousUser | None = None) -> dict[str, Any]:
    """A whole board with what it is the board of."""
    return {
        "race": race.slug,
        "name": race.name,
        "track": race.track.slug,
        "direction": race.direction,
        "state": str(race.state_at(now).value),
        **{name: getattr(race, name) for name in RANKING},
        "opens_at": race.opens_at.isoformat(),
        "closes_at": race.closes_at.isoformat(),
        "rows": [row_data(row) for row in whole_board(race, racer)],
    }


def csv_lines(rows: Iterable[BoardRow]) -> Iterator[str]:
    """The board as CSV, line by line, a heading first; an empty cell for None, 1 and 0 for yes and no."""
    writer = csv.writer(Echo(), lineterminator="\r\n")
    yield writer.writerow(COLUMNS)
    for row in rows:
        yield writer.writerow(int(one) if isinstance(one, bool) else plain(one) for one in row_data(row).values())


def plain(value: Any) -> Any:
    """What a spreadsheet shows and does not work out: text that begins like a formula gets an apostrophe in front."""
    return f"'{value}" if isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r")) else value


class Echo:
    """A file that hands back what is written to it."""

    def write(self, line: str) -> str:
        return line
