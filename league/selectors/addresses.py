"""Addresses of seasons: which are taken, reserved, or free."""

from __future__ import annotations

from django.db.models import Exists, OuterRef, QuerySet

from ..models import Round, Season
from ..models.season import RESERVED_SLUGS


def season_at(slug: str) -> Season | None:
    """The season that holds an address, in capital letters or small ones. One whose races are all cancelled holds
    none: see :func:`league.services.seasons.create_season`."""
    return _cancelled(Season.objects.filter(slug__iexact=slug), False).first()


def cancelled_at(slug: str) -> QuerySet[Season]:
    """The seasons at an address all of whose races are cancelled."""
    return _cancelled(Season.objects.filter(slug__iexact=slug), True)


def free_season_slug(slug: str) -> str:
    """This address, or one with a number behind it that no season has."""
    limit = Season._meta.get_field("slug").max_length or 50
    free, number = slug[:limit], 1
    while free.lower() in RESERVED_SLUGS or Season.objects.filter(slug__iexact=free).exists():
        number += 1
        free = f"{slug[: limit - 4]}-{number}"
    return free


def _cancelled(seasons: QuerySet[Season], whole: bool) -> QuerySet[Season]:
    rounds = Round.objects.filter(season=OuterRef("pk"))
    seasons = seasons.annotate(has_rounds=Exists(rounds), is_on=Exists(rounds.filter(race__cancelled_at=None)))
    wholly = {"has_rounds": True, "is_on": False}
    return seasons.filter(**wholly) if whole else seasons.exclude(**wholly)
