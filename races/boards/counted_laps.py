"""Measured laps as input of the ranking rules, with the race's penalties and resets applied."""

from collections.abc import Iterable
from typing import TypedDict

from django.db.models import Prefetch, QuerySet

from ..models import Entry, MeasuredLap, Race, TimedSession


class CountedLap(TypedDict):
    """A lap of a session, for :func:`races.boards.ranking.standing_in`."""

    number: int
    time_ms: int
    complete: bool
    completion_percentage: int
    off_tracks: int
    crashes: int
    resets: int


def sessions_that_count(entry: Entry) -> QuerySet[TimedSession]:
    """An entry's sessions that were not discarded, the first one first, with their laps in order: two queries."""
    laps = Prefetch("laps", MeasuredLap.objects.order_by("number"))
    sessions = TimedSession.objects.filter(entry=entry, discarded_at=None)
    return sessions.order_by("started_at", "number").prefetch_related(laps)


def counted_ms(race: Race, lap: MeasuredLap) -> int:
    """The counted time of a lap in milliseconds: measured time plus penalties."""
    return lap.time_ms + lap.off_tracks * race.off_track_penalty_ms


def is_complete(race: Race, lap: MeasuredLap) -> bool:
    return lap.valid and lap.resets <= race.max_resets


def counted_time(race: Race, lap: MeasuredLap) -> int | None:
    """The counted time of a lap in milliseconds; None for one that does not count."""
    return counted_ms(race, lap) if is_complete(race, lap) else None


def counted_laps(race: Race, laps: Iterable[MeasuredLap]) -> list[CountedLap]:
    """The laps of a session for the ranking rules; if the total ranks, only the first ``race.laps``."""
    measured = list(laps)
    if race.counts_all_laps:
        measured = measured[: race.laps]
    return [_lap(race, number, lap) for number, lap in enumerate(measured, start=1)]


def _lap(race: Race, number: int, lap: MeasuredLap) -> CountedLap:
    complete = is_complete(race, lap)
    return {
        "number": number,
        "time_ms": counted_ms(race, lap),
        "complete": complete,
        "completion_percentage": 100 if complete else 0,
        "off_tracks": lap.off_tracks,
        "crashes": 0,
        "resets": lap.resets,
    }
