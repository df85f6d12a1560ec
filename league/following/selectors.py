"""The latest results of followed racers."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.db.models import Q, QuerySet

from accounts.models import Follow, Racer
from core.events import Event, events_visible_to
from races.boards.selectors.board import CLASSIFIED, podiums
from races.events import RACE_OFFICIAL, RACE_RESULT, RACE_TIMED
from races.models import Entry, Race, Submission, TimedSession

from ..events import CUP_OVER, PROMOTED
from ..models import Cup, CupPlace, Membership, Season
from ..racers.selectors import LEAST

LATELY = timedelta(days=30)
LOOKED_AT = 200  # events of each sort
PROMOTIONS = 20
SHOWN = 40


@dataclass(frozen=True)
class Doing:
    """Something that a racer did. ``what``: ``best``, ``won`` (both in ``race``), ``cup`` (``division`` of it) or
    ``promoted``."""

    at: datetime
    what: str
    racer: Racer
    race: Race | None = None
    entry: Entry | None = None
    cup: Cup | None = None
    division: int = 0
    season: Season | None = None


def doings_of_followed(viewer: Racer, follows: Iterable[Follow], now: datetime) -> list[Doing]:
    """The latest results of the racers that ``viewer`` follows, of 30 days, in races that ``viewer`` can see: a dozen
    queries at most."""
    racers = {one.followed_id: one.followed for one in follows}
    if not racers:
        return []
    seen = events_visible_to(viewer).filter(at__gt=now - LATELY).order_by("-at", "-pk")
    driven = [RACE_RESULT.name, RACE_TIMED.name]
    found = [
        *_bests(list(seen.filter(kind__in=driven, racer__in=racers)[:LOOKED_AT]), racers),
        *_promoted(list(seen.filter(kind=PROMOTED.name, racer__in=racers)[:PROMOTIONS]), racers),
        *_won(seen.filter(kind=RACE_OFFICIAL.name), racers),
        *_cups(seen.filter(kind=CUP_OVER.name), racers, now),
    ]
    return sorted(found, key=lambda one: (one.at, one.racer.pk), reverse=True)[:SHOWN]


def _bests(events: list[Event], racers: dict[int, Racer]) -> list[Doing]:
    """Results and sessions with real cars that still are the racers' bests."""
    runs = Submission.objects.select_related("entry__race__track")
    sessions = TimedSession.objects.filter(discarded_at=None).select_related("entry__race")
    named = {name: [one.data[name] for one in events if name in one.data] for name in ("submission", "session")}
    driven: dict[object, Submission | TimedSession] = {**runs.in_bulk(named["submission"])}
    driven |= {str(pk): one for pk, one in sessions.in_bulk(named["session"]).items()}
    found: dict[int, Doing] = {}
    for event in events:
        best = driven.get(event.data.get("submission", event.data.get("session")))
        if best is None or best.pk not in (best.entry.best_id, best.entry.best_session_id):
            continue
        entry = best.entry
        if not entry.is_withdrawn and entry.classified:
            found.setdefault(entry.pk, Doing(event.at, "best", racers[entry.racer_id], entry.race, entry))
    return list(found.values())


def _promoted(events: list[Event], racers: dict[int, Racer]) -> list[Doing]:
    seasons = Season.objects.in_bulk([one.subject for one in events], field_name="slug")
    rounds = [one.data["round"] for one in events]
    holding = set(Membership.objects.filter(promoted_in__in=rounds).values_list("promoted_in", "racer"))
    return [
        Doing(one.at, "promoted", racers[one.racer_id], season=seasons[one.subject])
        for one in events
        if one.racer_id is not None and one.subject in seasons and (one.data["round"], one.racer_id) in holding
    ]


def _won(events: QuerySet[Event], racers: dict[int, Racer]) -> list[Doing]:
    """Official races with at least two classified racers; the events of cups cover their races."""
    entered = Entry.objects.filter(CLASSIFIED, racer__in=racers, withdrawn_at=None, is_baseline=False)
    official = list(events.filter(race__in=entered.order_by().values("race"))[:LOOKED_AT])
    in_cups = Q(cup__isnull=False) | Q(cup_division__isnull=False)
    single = Race.objects.exclude(in_cups).filter(cancelled_at=None)
    races = single.in_bulk({one.race for one in official if one.race is not None})
    first = podiums(races.values(), size=LEAST)
    found: dict[int, Doing] = {}
    for event in official:
        rows = [] if event.race is None else first.get(event.race, [])
        if event.race is not None and len(rows) >= LEAST and rows[0].racer.pk in racers:
            racer = racers[rows[0].racer.pk]
            found.setdefault(event.race, Doing(event.at, "won", racer, races[event.race], rows[0].entry))
    return list(found.values())


def _cups(events: QuerySet[Event], racers: dict[int, Racer], now: datetime) -> list[Doing]:
    won = CupPlace.objects.filter(racer__in=racers, place=1, cup__over_at__gt=now - LATELY).select_related("cup")
    places = list(won.order_by("-cup__day", "division")[:LOOKED_AT])
    days = {one.cup.day.isoformat() for one in places}
    at = dict(events.filter(subject__in=days).values_list("subject", "at"))
    return [
        Doing(at[day], "cup", racers[one.racer_id], cup=one.cup, division=one.division)
        for one in places
        if (day := one.cup.day.isoformat()) in at
    ]
