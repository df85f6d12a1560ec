"""The series of a class: its races together, with points by place."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import datetime

from accounts.models import Classroom, Racer
from races.models import Race
from races.selectors.boards import CLASSIFIED, board_entries

POINTS = (25, 18, 15, 12, 10, 8, 6, 4, 2, 1)  # as a season gives them unless told otherwise
RACES = 20  # the newest


@dataclass
class SeriesRow:
    """A racer: ``cells`` has the place in each race of the series, None where there is none."""

    racer: Racer
    place: int = 0
    points: int = 0
    cells: list[int | None] = field(default_factory=list)

    @property
    def key(self) -> tuple[int, list[int], str]:
        """The most points first, then who has the better places."""
        return -self.points, sorted(place for place in self.cells if place is not None), self.racer.alias


@dataclass(frozen=True)
class Series:
    """``races``: the first one first. ``rows``: who has a place in one of them. Races that are open count as they
    stand."""

    races: list[Race]
    rows: list[SeriesRow]
    is_provisional: bool


def series_of(classroom: Classroom, now: datetime, without: Collection[int] = ()) -> Series:
    """The races of a class that have begun. One query, and one for each race. ``without``: ids of races whose results
    are hidden from the reader."""
    races = Race.objects.filter(group=classroom.group_id, cancelled_at=None, opens_at__lte=now).exclude(pk__in=without)
    shown = list(races.order_by("-opens_at", "-pk")[:RACES])[::-1]
    rows: dict[int, SeriesRow] = {}
    for at, race in enumerate(shown):
        ranked = board_entries(race).filter(CLASSIFIED, is_baseline=False).select_related("racer")
        for place, entry in enumerate(ranked, start=1):
            row = rows.setdefault(entry.racer_id, SeriesRow(entry.racer, cells=[None] * len(shown)))
            row.cells[at] = place
            row.points += POINTS[place - 1] if place <= len(POINTS) else 0
    ordered = sorted(rows.values(), key=lambda row: row.key)
    for place, row in enumerate(ordered, start=1):
        alike = place > 1 and row.key[:2] == ordered[place - 2].key[:2]
        row.place = ordered[place - 2].place if alike else place
    return Series(shown, ordered, is_provisional=any(race.closes_at > now for race in shown))
