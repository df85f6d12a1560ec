"""Results that are hidden from a reader (:mod:`races.spoilers`) on pages of the league and in notices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from django.db.models import Q
from django.http import HttpRequest
from django.utils.translation import gettext as _

from accounts.following import followed_by
from accounts.models import Racer
from evaluation.models import Evaluation
from races.models import Entry, Race
from races.names import named
from races.spoiler_pages import register_scope
from races.spoilers import spoilers_of_racer

from .models import Cup, Notice, NoticeKind, Round, Season

# What tells nothing of results.
_HARMLESS = (
    *(NoticeKind.OPENS, NoticeKind.CLOSES, NoticeKind.MESSAGE, NoticeKind.CANCELLED, NoticeKind.TEAM),
    NoticeKind.SEASON,
)


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
    register_scope(_of_racer, "racer")
    register_scope(_of_followed, "following")


def spoiling(racer: Racer) -> Q:
    """Of the racer's notices, those that tell of results which are hidden from them."""
    return ~Q(kind__in=_HARMLESS) & Q(path__in=_hidden_paths(racer))


def told_instead(notice: Notice) -> str:
    """What a mail says where its notice would tell of hidden results, in the present language; else ""."""
    racer = notice.racer
    if racer.hides_results_since is None or notice.kind in _HARMLESS or notice.path not in _hidden_paths(racer):
        return ""
    name = notice.params.get("race") or notice.params.get("season") or ""
    if not name:
        return _("There is news about results that you hide.")
    return _("There is news of %(race)s, which you have not watched yet.") % {"race": named(name)}


def _hidden_paths(racer: Racer) -> set[str]:
    """Where notices lead to that may tell of hidden results: races, one's own runs in them, their seasons and cups."""
    hidden = spoilers_of_racer(racer).hidden
    if not hidden:
        return set()
    races = Race.objects.filter(pk__in=hidden)
    paths = {race.get_absolute_url() for race in races}
    runs = Evaluation.objects.filter(owner=racer, submission__entry__race__in=hidden)
    paths |= {run.get_absolute_url() for run in runs.only("public_id")}
    for season in Season.objects.filter(rounds__race__in=hidden).distinct():
        page = season.get_absolute_url()
        paths |= {page, f"{page}finales/"}
    cups = Cup.objects.filter(Q(race__in=hidden) | Q(divisions__race__in=hidden)).distinct()
    return paths | {cup.get_absolute_url() for cup in cups}
