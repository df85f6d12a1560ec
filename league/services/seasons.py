"""Seasons, their rounds, and who is in which division."""

from __future__ import annotations

from datetime import date, datetime
from typing import Any

from django.db import transaction

from races.services import create_league_race

from ..models import Membership, Racer, Round, Season


@transaction.atomic
def create_season(*, slug: str, name: str, starts_on: date, ends_on: date) -> Season:
    """Make a season that lasts from ``starts_on`` to ``ends_on``, both included. Raises ValidationError."""
    season = Season(slug=slug, name=name, starts_on=starts_on, ends_on=ends_on)
    season.full_clean()
    season.save(force_insert=True)
    return season


@transaction.atomic
def schedule_round(*, season: Season, number: int, now: datetime, division: str, **race: Any) -> Round:
    """Make a league race and the round that it is: one race for each division and number of a season.

    ``race``: as for :func:`races.services.create_league_race`. Raises RaceRefused, ValidationError.
    """
    round_ = Round(season=season, number=number, race=create_league_race(now=now, division=division, **race))
    round_.full_clean()
    round_.save(force_insert=True)
    return round_


@transaction.atomic
def put_in_division(*, season: Season, racer: Racer, division: str, now: datetime) -> Membership:
    """Put a racer into a division for the rest of a season. What they have driven in the other one stays there."""
    membership = Membership.objects.select_for_update().filter(season=season, racer=racer).first()
    if membership is not None and membership.division == division:
        return membership
    membership = membership or Membership(season=season, racer=racer)
    membership.division, membership.since = division, now
    membership.full_clean()
    membership.save()
    return membership
