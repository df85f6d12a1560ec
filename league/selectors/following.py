"""What racers whom somebody follows did lately."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from django.db.models import Q, QuerySet

from accounts.following import followed_by
from accounts.models import Racer
from core.events import Event, events_visible_to
from races.events import RACE_OFFICIAL, RACE_RESULT, RACE_TIMED
from races.models import Entry, Race, Submission, TimedSession
from races.selectors import podiums
from races.selectors.boards import CLASSIFIED

from ..events import CUP_OVER, PROMOTED
from ..models import Cup, CupPlace, Season
from .honours import LEAST
from .outcomes import holds

LATELY = timedelta(days=30)
LOOKED_AT = 200  # events of each sort
PROMOTIONS = 20  # each is looked up by itself
SHOWN = 40


@dataclass(frozen=True)
class Doing:
    """Something that a racer did. ``what``: ``best`` (a new best in ``race``), ``won`` (``race``), ``cup`` (division
    ``division`` of ``cup``) or ``promoted`` (in ``season``)."""

    at: datetime
    what: str
    racer: Racer
    race: Race | None = None
    entry: Entry | None = None
    cup: Cup | None = None
    division: int = 0
    season: Season | None = None


def doings_of_followed(viewer: Racer, now: datetime) -> list[Doing]:
    """What those whom ``viewer`` follows did in the last 30 days, of all that ``viewer`` may see, the latest first, at
    most ``SHOWN``: a dozen queries, however many they are. A best stands once for each race, as it is now."""
    racers = {one.followed_id: one.followed for one in followed_by(viewer)}
    if not racers:
        return []
    seen = events_visible_to(viewer).filter(at__gt=now - LATELY).order_by("-at", "-pk")
    found = [
        *_bests(list(seen.filter(kind=RACE_RESULT.name, racer__in=racers)[:LOOKED_AT]), racers),
        *_timed(list(seen.filter(kind=RACE_TIMED.name, racer__in=racers)[:LOOKED_AT]), racers),
        *_promoted(list(seen.filter(kind=PROMOTED.name, racer__in=racers)[:PROMOTIONS]), racers),
        *_won(seen.filter(kind=RACE_OFFICIAL.name), racers),
        *_cups(seen.filter(kind=CUP_OVER.name), racers, now),
    ]
    return sorted(found, key=lambda one: (one.at, one.racer.pk), reverse=True)[:SHOWN]


def _bests(events: list[Event], racers: dict[int, Racer]) -> list[Doing]:
    """Results that count as the racers' bests still; who may see a run of somebody else sees it by that."""
    sent = Submission.objects.select_related("entry__race__track").in_bulk([one.data["submission"] for one in events])
    found: dict[int, Doing] = {}
    for event in events:
        submission = sent.get(event.data["submission"])
        if submission is None or submission.entry.best_id != submission.pk:
            continue
        entry = submission.entry
        if not entry.is_withdrawn and entry.classified:
            found.setdefault(entry.pk, Doing(event.at, "best", racers[entry.racer_id], entry.race, entry))
    return list(found.values())


def _timed(events: list[Event], racers: dict[int, Racer]) -> list[Doing]:
    """Sessions with a real car whose laps are the racers' bests still."""
    ids = [one.data["session"] for one in events]
    sessions = {str(pk): one for pk, one in TimedSession.objects.select_related("entry__race").in_bulk(ids).items()}
    found: dict[int, Doing] = {}
    for event in events:
        session = sessions.get(event.data["session"])
        if session is None or session.discarded_at is not None:
            continue
        entry = session.entry
        if entry.best_session_id == session.pk and not entry.is_withdrawn and entry.classified:
            found.setdefault(entry.pk, Doing(event.at, "best", racers[entry.racer_id], entry.race, entry))
    return list(found.values())


def _promoted(events: list[Event], racers: dict[int, Racer]) -> list[Doing]:
    """Promotions that hold still."""
    seasons = Season.objects.in_bulk([one.subject for one in events], field_name="slug")
    return [
        Doing(one.at, "promoted", racers[one.racer_id], season=seasons[one.subject])
        for one in events
        if one.racer_id is not None and one.subject in seasons and holds(one)
    ]


def _won(events: QuerySet[Event], racers: dict[int, Racer]) -> list[Doing]:
    """Races whose official results somebody won against somebody else; those of a cup are told of with it."""
    entered = Entry.objects.filter(CLASSIFIED, racer__in=racers, withdrawn_at=None, is_baseline=False)
    official = list(events.filter(race__in=entered.order_by().values("race"))[:LOOKED_AT])
    in_cups = Q(cup__isnull=False) | Q(cup_division__isnull=False)
    races = (
        Race.objects.exclude(in_cups)
        .filter(cancelled_at=None)
        .in_bulk({one.race for one in official if one.race is not None})
    )
    first = podiums(races.values(), size=LEAST)
    found: dict[int, Doing] = {}
    for event in official:
        rows = [] if event.race is None else first.get(event.race, [])
        if event.race is not None and len(rows) >= LEAST and rows[0].racer.pk in racers:
            racer = racers[rows[0].racer.pk]
            found.setdefault(event.race, Doing(event.at, "won", racer, races[event.race], rows[0].entry))
    return list(found.values())


def _cups(events: QuerySet[Event], racers: dict[int, Racer], now: datetime) -> list[Doing]:
    """Divisions of cups that somebody won."""
    won = CupPlace.objects.filter(racer__in=racers, place=1, cup__over_at__gt=now - LATELY).select_related("cup")
    places = list(won.order_by("-cup__day", "division")[:LOOKED_AT])
    days = {one.cup.day.isoformat() for one in places}
    at = dict(events.filter(subject__in=days).values_list("subject", "at"))
    return [
        Doing(at[day], "cup", racers[one.racer_id], cup=one.cup, division=one.division)
        for one in places
        if (day := one.cup.day.isoformat()) in at
    ]
