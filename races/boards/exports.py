"""A board as plain data, for CSV and JSON exports."""

import csv
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from typing import Annotated, Any, TypedDict

from paddock.rules.race import RANKING

from ..models import Race
from .selectors.board import BoardRow, whole_board


class ExportedRow(TypedDict):
    """One row of a board; times in whole milliseconds, None where there is none."""

    rank: Annotated[int | None, "null for house cars and unclassified racers."]
    racer: str
    country: str
    baseline: Annotated[bool, "A house car, outside the ranking."]
    classified: bool
    score_ms: Annotated[int | None, "What the race ranks by, until duels are drawn."]
    gap_ms: Annotated[int | None, "To the leader."]
    average_ms: int | None
    best_lap_ms: int | None
    total_ms: int | None
    complete_laps: int
    sector_1_ms: Annotated[int | None, "Of the best lap."]
    sector_2_ms: int | None
    sector_3_ms: int | None
    off_tracks: int
    resets: int
    submissions: int
    submitted_at: str | None
    seed: Annotated[int | None, "In a race of duels once drawn; what stands above is then the qualifying."]
    points: int | None
    duels: Annotated[int | None, "Heats decided."]
    duel_lap_ms: Annotated[int | None, "Average of all complete laps in duels."]
    guest: Annotated[bool, "A racer without an account; `racer` is the name that was typed."]


COLUMNS = tuple(ExportedRow.__annotations__)


def row_data(row: BoardRow) -> ExportedRow:
    entry = row.entry
    sectors = [*entry.sectors, None, None, None]
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
        "sector_1_ms": sectors[0],
        "sector_2_ms": sectors[1],
        "sector_3_ms": sectors[2],
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


def board_data(race: Race, now: datetime) -> dict[str, object]:
    return {
        "race": race.slug,
        "name": race.name,
        "track": race.track.slug,
        "direction": race.direction,
        "state": str(race.state_at(now).value),
        **{name: getattr(race, name) for name in RANKING},
        "opens_at": race.opens_at.isoformat(),
        "closes_at": race.closes_at.isoformat(),
        "rows": [row_data(row) for row in whole_board(race)],
    }


def board_csv(race: Race) -> Iterator[str]:
    """The board as CSV lines (:func:`csv_lines`)."""
    return csv_lines(COLUMNS, (row_data(row).values() for row in whole_board(race)))


def csv_lines(heading: Sequence[str], rows: Iterable[Iterable[Any]]) -> Iterator[str]:
    """Rows as CSV, line by line, the heading first; an empty cell for None, 1 and 0 for yes and no."""
    writer = csv.writer(Echo(), lineterminator="\r\n")
    yield writer.writerow(heading)
    for row in rows:
        yield writer.writerow(int(one) if isinstance(one, bool) else plain(one) for one in row)


def plain(value: Any) -> Any:
    """A cell that a spreadsheet shows unevaluated: text that begins like a formula gets an apostrophe in front."""
    return f"'{value}" if isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r")) else value


class Echo:
    """A file whose write method returns its argument."""

    def write(self, line: str) -> str:
        return line
