"""Ratings of a season, from its duels."""

from __future__ import annotations

from django.db import transaction

from races.duels.ratings import rate
from races.models import DuelCompetitor, DuelState

from ..models import DuelRating, Season


@transaction.atomic
def rate_season(*, season: Season) -> int:
    """Work out the ratings of a season anew from every duel that was driven in it; returns how many racers have one.

    Duels count in the order of their races' closing times, then rounds and numbers, however they came in: the same
    duels always give the same ratings. Walkovers and cars that did not start say nothing; those that retired are level
    in the last place.
    """
    ratings = rate(_places(season))
    DuelRating.objects.filter(season=season).delete()
    DuelRating.objects.bulk_create(
        DuelRating(season=season, racer_id=racer, mu=one.mu, sigma=one.sigma, duels=one.duels)
        for racer, one in ratings.items()
    )
    return len(ratings)


def _places(season: Season) -> list[dict[int, int]]:
    """The places by racer of each driven duel of a season, in their fixed order."""
    cars = (
        DuelCompetitor.objects.filter(
            duel__race__round__season=season,
            duel__race__draw__over_at__isnull=False,
            duel__state=DuelState.DECIDED,
            duel__evaluation__isnull=False,
            forfeited=False,
        )
        .order_by("duel__race__closes_at", "duel__race", "duel__round", "duel__number", "grid")
        .values_list("duel", "entry__racer", "place", "retired_code")
    )
    duels: dict[int, dict[int, int]] = {}
    last = 1 + max((place or 0 for _, _, place, _ in cars), default=0)
    for duel, racer, place, retired in cars:
        duels.setdefault(duel, {})[racer] = last if retired or place is None else place
    return list(duels.values())
