"""Who is in which division."""

from __future__ import annotations

from typing import TYPE_CHECKING

from accounts.models import Racer
from races.models import Division, Race

from ..models import Membership, Round, Season

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


def division_of(season: Season | None, racer: Racer | AnonymousUser | None) -> Division:
    """The racer's division in a season: open unless they were promoted."""
    if season is None or racer is None or not racer.is_authenticated:
        return Division.OPEN
    membership = Membership.objects.filter(season=season, racer_id=racer.pk).first()
    return Division.OPEN if membership is None else Division(membership.division)


def season_of(race: Race) -> Season | None:
    """The season that a race is a round of, or None."""
    round_ = Round.objects.filter(race=race).select_related("season").first()
    return None if round_ is None else round_.season
