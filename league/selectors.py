"""What pages and checks ask of the league."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from django.db.models import QuerySet
from django.utils import timezone

from races.models import Division, Kind, Race

from .models import Membership, Racer, Round, Season

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser


def season_at(now: datetime) -> Season | None:
    """The season that runs at ``now`` by the site's calendar; the one that began last where two do."""
    today = timezone.localdate(now, timezone.get_default_timezone())
    return Season.objects.filter(starts_on__lte=today, ends_on__gte=today).order_by("-starts_on", "-pk").first()


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


def rounds_of(season: Season) -> QuerySet[Round]:
    """All rounds of a season in order, the open race of a month before the pro one."""
    return season.rounds.select_related("race__track").order_by("number", "race__division", "pk")


def current_league_races(now: datetime, racer: Racer | AnonymousUser | None = None) -> list[Race]:
    """The league's races that are open at ``now``, those of the racer's own division first."""
    races = Race.objects.filter(kind=Kind.LEAGUE, cancelled_at=None, opens_at__lte=now, closes_at__gt=now)
    mine = division_of(season_at(now), racer)
    return sorted(races.select_related("track").order_by("closes_at", "pk"), key=lambda race: race.division != mine)
