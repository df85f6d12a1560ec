"""The latest results of followed racers."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, TypedDict, cast

from django.db.models import Exists, OuterRef, Q, QuerySet

from accounts.models import Follow, Racer
from core.database.kept_queries import KeptQuery
from core.events import Event
from core.streams.shared_pieces import shared_value
from races.boards.selectors.board import podiums
from races.entries.selectors.visibility import races_visible_to
from races.events import RACE_OFFICIAL, RACE_RESULT, RACE_TIMED
from races.models import Entry, Race, Visibility

from ..events import CUP_OVER, PROMOTED
from ..models import Cup, CupPlace, Membership, Season
from ..racers.selectors import LEAST

LATELY = timedelta(days=30)
MOMENT = timedelta(microseconds=1)
LOOKED_AT, WINS = 200, 500  # results of followed racers and cups; official races of all
PROMOTIONS = 20
SHOWN = 40


class FollowedData(TypedDict, total=False):
    """The data of an event of a followed racer: a run or session that was timed, or the round of a promotion."""

    submission: int
    session: str
    round: int


# Kind, time, racer, race, subject and data of an event
EventRow = tuple[str, datetime, int, int | None, str, FollowedData]


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


# A race by its id, whether everybody sees it, and what a racer did there
Found = tuple[int, bool, Doing]


def doings_of_followed(viewer: Racer, follows: Iterable[Follow], now: datetime) -> list[Doing]:
    """The latest results of the racers that ``viewer`` follows, of 30 days, in races that ``viewer`` can see: four
    queries at most. Official races and cups are read once for all readers."""
    racers = {one.followed_id: one.followed for one in follows}
    if not racers:
        return []
    events = _events(follower=viewer.pk, since=now - LATELY)
    found = [*_bests(viewer, events, racers), *_promoted(events, racers)]
    for shared, read in (("races", _won), ("cups", _cups)):
        lately = shared_value((shared, "won lately"), lambda read=read: list(read(now)))  # type: ignore[misc]
        found += (one for one in lately if one[2].racer.pk in racers)
    doings = _visible_to(viewer, found)
    return sorted(doings, key=lambda one: (one.at, one.racer.pk), reverse=True)[:SHOWN]


def _visible_to(viewer: Racer, found: Iterable[Found]) -> list[Doing]:
    """What happened in races that the viewer sees: one query if any is not public."""
    found = list(found)
    hidden = {race for race, is_public, _doing in found if not is_public}
    seen = set(races_visible_to(viewer).filter(pk__in=hidden).values_list("pk", flat=True)) if hidden else set()
    return [doing for race, is_public, doing in found if is_public or race in seen]


def _followed(follower: Any) -> QuerySet[Follow, Any]:
    return Follow.objects.filter(follower_id=follower).values("followed")


def _recent(follower: Any, since: Any) -> QuerySet[Event, Any]:
    """Kind, time, racer, race, subject and data of the latest events of followed racers."""
    seen = Event.objects.filter(racer__in=_followed(follower), at__gt=since).order_by("-at", "-pk").values("pk")
    driven = seen.filter(kind__in=[RACE_RESULT.name, RACE_TIMED.name])[:LOOKED_AT]
    promoted = seen.filter(kind=PROMOTED.name)[:PROMOTIONS]
    found = Event.objects.filter(Q(pk__in=driven) | Q(pk__in=promoted)).order_by("-at", "-pk")
    return found.values_list("kind", "at", "racer", "race", "subject", "data")


_events: KeptQuery[EventRow] = KeptQuery(_recent)


def _classified(follower: Any, since: Any) -> QuerySet[Entry]:
    """Entries of followed racers in races where they drove lately."""
    driven = Event.objects.filter(racer__in=_followed(follower), at__gt=since)
    driven = driven.filter(kind__in=[RACE_RESULT.name, RACE_TIMED.name], race=OuterRef("race"), racer=OuterRef("racer"))
    mine = Entry.objects.filter(Exists(driven), racer__in=_followed(follower), classified=True, withdrawn_at=None)
    race = [f"race__{name}" for name in ("slug", "name", "visibility", "duel_format")]
    return mine.select_related("race").only("racer", "best", "best_session", "score_ms", "seed", "points", *race)


_entries = KeptQuery(_classified)


def _bests(viewer: Racer, events: Iterable[EventRow], racers: dict[int, Racer]) -> Iterator[Found]:
    """Results and sessions with real cars that still are the racers' bests."""
    at: dict[str, datetime] = {}
    for kind, when, _racer, _race, _subject, data in events:
        if kind != PROMOTED.name:
            at.setdefault(str(data.get("submission", data.get("session"))), when)
    for entry in _entries(follower=viewer.pk, since=min(at.values()) - MOMENT) if at else ():
        counted = next((each for each in map(str, (entry.best_id, entry.best_session_id)) if each in at), None)
        if counted is not None and entry.racer_id in racers:
            doing = Doing(at[counted], "best", racers[entry.racer_id], entry.race, entry)
            yield entry.race_id, entry.race.visibility == Visibility.PUBLIC, doing


def _promoted(events: Iterable[EventRow], racers: dict[int, Racer]) -> Iterator[Found]:
    rows = [row for row in events if row[0] == PROMOTED.name]
    if not rows:
        return
    held = Membership.objects.filter(promoted_in__in=[row[5]["round"] for row in rows], racer__in=racers)
    held = held.select_related("season", "promoted_in__race").only(
        *("racer", "season__slug", "season__name", "promoted_in__race__visibility")
    )
    memberships = {(one.season.slug, one.promoted_in_id, one.racer_id): one for one in held}
    for _kind, when, racer, race, subject, data in rows:
        held_by = memberships.get((subject, data["round"], racer))
        if held_by is not None and held_by.promoted_in is not None and race is not None:
            is_public = held_by.promoted_in.race.visibility == Visibility.PUBLIC
            yield race, is_public, Doing(when, "promoted", racers[racer], season=held_by.season)


def _won(now: datetime) -> Iterator[Found]:
    """Official races with at least two classified racers, by all winners; the events of cups cover their races."""
    official = Event.objects.filter(kind=RACE_OFFICIAL.name, at__gt=now - LATELY, race__isnull=False)
    at: dict[int, datetime] = {}
    for race, when in official.order_by("-at", "-pk").values_list("race", "at")[:WINS]:
        at.setdefault(cast(int, race), when)
    in_cups = Q(cup__isnull=False) | Q(cup_division__isnull=False)
    races = Race.objects.exclude(in_cups).filter(cancelled_at=None).in_bulk(at)
    for pk, rows in podiums(races.values(), size=LEAST).items():
        if len(rows) >= LEAST:
            doing = Doing(at[pk], "won", rows[0].racer, races[pk], rows[0].entry)
            yield pk, races[pk].visibility == Visibility.PUBLIC, doing


def _cups(now: datetime) -> Iterator[Found]:
    won = CupPlace.objects.filter(place=1, cup__over_at__gt=now - LATELY).select_related("cup__race", "racer")
    places = list(won.order_by("-cup__day", "division")[:LOOKED_AT])
    days = {one.cup.day.isoformat() for one in places}
    at = dict(Event.objects.filter(kind=CUP_OVER.name, subject__in=days).values_list("subject", "at"))
    for one in places:
        if (day := one.cup.day.isoformat()) in at:
            race = one.cup.race
            doing = Doing(at[day], "cup", one.racer, cup=one.cup, division=one.division)
            yield race.pk, race.visibility == Visibility.PUBLIC, doing
