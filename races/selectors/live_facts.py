"""What there is to say of the racers of a live event: their figures in it, and how they fared against each other."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from itertools import groupby
from typing import TYPE_CHECKING

from ..models import Entry, LiveEvent, LiveRacer
from .live import LiveRow, live_standings
from .live_runs import DrivenRun, shown_runs
from .live_screens import best_sectors
from .visibility import races_visible_to

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

MOST_RACERS = 16  # of a table of all against all
MOST_RESULTS = 4000


@dataclass(frozen=True)
class Facts:
    """A racer: how they stand, their best sectors (ms) and what went wrong in the runs that were shown."""

    row: LiveRow
    sectors: list[int | None]
    off_tracks: int
    crashes: int


@dataclass(frozen=True)
class Met:
    """Earlier races that both finished: how often ``racer`` was before each other one. None with itself."""

    racer: str
    against: list[tuple[int, int] | None]


def facts_of(event: LiveEvent) -> list[Facts]:
    """Of every racer in the running order, as they stand."""
    runs = shown_runs(event)
    by_racer: dict[int, list[DrivenRun]] = {}
    for run in runs:
        by_racer.setdefault(run.slot.racer_id or 0, []).append(run)
    return [
        Facts(
            row,
            best_sectors(by_racer.get(row.racer.pk, [])),
            sum(run.standing.off_tracks for run in by_racer.get(row.racer.pk, []) if run.standing),
            sum(run.standing.crashes for run in by_racer.get(row.racer.pk, []) if run.standing),
        )
        for row in live_standings(event)
    ]


def met_before(event: LiveEvent, reader: Racer | AnonymousUser | None, now: datetime) -> list[Met]:
    """The first sixteen racers against each other, in races that are closed and that the reader may see."""
    racers = LiveRacer.objects.filter(event=event).select_related("entry__racer").order_by("qualified_rank", "pk")
    who = [racer.entry.racer for racer in racers[:MOST_RACERS]]
    races = races_visible_to(reader).filter(cancelled_at=None, closes_at__lte=now).exclude(pk=event.race_id).order_by()
    results = Entry.objects.filter(
        race__in=races.values("pk"), racer__in=who, classified=True, withdrawn_at=None, is_baseline=False
    ).order_by("-race", "rank_score", "rank_lap", "resets", "achieved_at", "pk")
    before: dict[tuple[int, int], int] = {}
    found = results.values_list("race", "racer")[:MOST_RESULTS]
    for _race, rows in groupby(found, key=lambda row: row[0]):
        order = [racer for _, racer in rows]
        for place, one in enumerate(order):
            for other in order[place + 1 :]:
                before[one, other] = before.get((one, other), 0) + 1
    return [
        Met(
            one.alias,
            [
                None if one == other else (before.get((one.pk, other.pk), 0), before.get((other.pk, one.pk), 0))
                for other in who
            ],
        )
        for one in who
    ]
