"""Ratings as pages show them."""

from __future__ import annotations

from collections.abc import Sequence

from django.db.models import F, QuerySet, Window
from django.db.models.functions import Rank

from accounts.models import Racer

from ..models import DuelRating, Season

SHOWN = F("mu") - 3.0 * F("sigma")


def season_ratings(season: Season, limit: int | None = None) -> Sequence[DuelRating]:
    """The ratings of a season, the highest first, each with its ``place`` (equal ratings share one). One query."""
    return list(_placed().filter(season=season)[:limit])


def racer_ratings(racer: Racer) -> Sequence[DuelRating]:
    """The racer's rating in each season that they drove duels in, with their ``place``, the latest season first."""
    seasons = DuelRating.objects.filter(racer=racer).values("season")
    placed = _placed().filter(season__in=seasons).select_related("season").order_by("-season__starts_on", "season")
    return [one for one in placed if one.racer_id == racer.pk]


def _placed() -> QuerySet[DuelRating]:
    place = Window(Rank(), partition_by=[F("season")], order_by=SHOWN.desc())
    rated = DuelRating.objects.select_related("racer").annotate(level=SHOWN, place=place)
    return rated.order_by("-level", "racer__alias")
