"""Laps that were measured at a track, as the rules of ranking read laps (:mod:`races.ranking`).

What was measured stays as it is; what the race's rules make of it is worked out here: each off track adds the race's
penalty, more resets than it allows make a lap invalid, and a lap that is not valid is one that was not finished.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from django.db.models import Prefetch, QuerySet

from .models import MeasuredLap, RankingMethod, TimedSession

if TYPE_CHECKING:
    from .models import Entry, Race


def sessions_that_count(entry: Entry) -> QuerySet[TimedSession]:
    """An entry's sessions that were not discarded, the first one first, with their laps in order: two queries."""
    laps = Prefetch("laps", MeasuredLap.objects.order_by("number"))
    sessions = TimedSession.objects.filter(entry=entry, discarded_at=None)
    return sessions.order_by("started_at", "number").prefetch_related(laps)


def counted_ms(race: Race, lap: MeasuredLap) -> int:
    """What a lap counts with, in milliseconds: what was measured and the penalties."""
    return lap.time_ms + lap.off_tracks * race.off_track_penalty_ms


def is_complete(race: Race, lap: MeasuredLap) -> bool:
    """Whether a lap counts."""
    return lap.valid and lap.resets <= race.max_resets


def counted_laps(race: Race, laps: Iterable[MeasuredLap]) -> list[dict[str, Any]]:
    """The laps of a session, given in their order, for :func:`races.ranking.standing_in`.

    Where the total ranks, the first laps of the session count, as many as the race has.
    """
    measured = list(laps)
    if race.ranking_method == RankingMethod.TOTAL:
        measured = measured[: race.laps]
    return [_lap(race, number, lap) for number, lap in enumerate(measured, start=1)]


def _lap(race: Race, number: int, lap: MeasuredLap) -> dict[str, Any]:
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
