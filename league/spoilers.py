"""Hidden results (:mod:`races.spoilers.selectors`) on pages of the league."""

from collections.abc import Iterable, Mapping
from typing import Any

from django.db.models import Q
from django.http import HttpRequest

from accounts.following import followed_by
from races.models import Entry, Race
from races.spoilers.hidden_addresses import register_scope

from .models import Cup, Round


def _of_season(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    return Round.objects.filter(season__slug=named["slug"]).order_by().values_list("race", flat=True)


def _of_all_seasons(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    return Round.objects.order_by().values_list("race", flat=True)


def _of_cups(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    races = Race.objects.filter(Q(cup__isnull=False) | Q(cup_division__isnull=False))
    return races.order_by().values_list("pk", flat=True)


def _of_cup(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    try:
        cups = list(Cup.objects.filter(day=named["day"]))
    except (ValueError, TypeError):
        return ()
    return _races_of(cups)


def _races_of(cups: Iterable[Cup]) -> Iterable[int]:
    races = Race.objects.filter(Q(cup__in=cups) | Q(cup_division__cup__in=cups))
    return races.order_by().values_list("pk", flat=True)


def _of_racer(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    return Entry.objects.filter(racer__alias__iexact=named["alias"]).order_by().values_list("race", flat=True)


def _of_followed(request: HttpRequest, named: Mapping[str, Any]) -> Iterable[int]:
    racers = [one.followed_id for one in followed_by(request.user)] if request.user.is_authenticated else []
    return Entry.objects.filter(racer__in=racers).order_by().values_list("race", flat=True)


def register() -> None:
    """The addresses of this room that show results."""
    register_scope(
        _of_season,
        *("season", "season_standings", "standings_file", "season_fields", "season_racer"),
        *("api-standings", "api-racer-season", "api-rounds"),
    )
    register_scope(_of_all_seasons, "hall")
    register_scope(_of_cups, "cups", "api-cups")
    register_scope(_of_cup, "cup", "api-cup")
    register_scope(_of_racer, "racer", "api-racer")
    register_scope(_of_followed, "following")
