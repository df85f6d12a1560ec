"""The clock of the league, which records the events that come with time, each once, up to :data:`REACH` late."""

from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta

from django.db.models import QuerySet

from core.events import Event, EventKind, record_all, written
from races.events import RACE_CLOSED, RACE_CLOSING, RACE_OFFICIAL, RACE_OPENED, of_race
from races.models import Race, RaceKind

from ...stewarding.official_results import cars_on_the_way
from .succession import continue_seasons

REACH = timedelta(days=3)
A_DAY = timedelta(days=1)


def tick(*, now: datetime) -> int:
    """Draft following seasons, and record races that opened, closed or became official by time; returns the new
    events."""
    drafted = continue_seasons(now=now)
    races = Race.objects.filter(cancelled_at=None, imported_at=None).order_by("closes_at", "pk")
    opened = races.filter(opens_at__gt=now - REACH, opens_at__lte=now)
    # a race of at most a day has only just sent its notice of opening
    closing = races.filter(opens_at__lte=now - A_DAY, closes_at__gt=now, closes_at__lte=now + A_DAY)
    closed = races.filter(closes_at__gt=now - REACH, closes_at__lte=now)
    new = record_all(_timed(RACE_OPENED, opened, "opens_at"))
    new += record_all(_timed(RACE_CLOSING, closing, "closes_at"))
    new += record_all(_timed(RACE_CLOSED, closed, "closes_at"))
    return len(drafted) + new + record_all(_settled(closed, now))


def _timed(kind: EventKind, races: Iterable[Race], when: str) -> Iterator[Event]:
    for race in races:
        time = getattr(race, when)
        yield written(kind, at=time, **of_race(race), once=f"{race.slug}:{time:%Y%m%d%H%M}")


def _settled(closed: QuerySet[Race], now: datetime) -> Iterator[Event]:
    """Community races that have closed and timed their last car."""
    races = {f"{race.slug}:": race for race in closed.filter(kind=RaceKind.COMMUNITY)}
    known = Event.objects.filter(kind=RACE_OFFICIAL.name, once__in=races).values_list("once", flat=True)
    for once in races.keys() - set(known):
        if not cars_on_the_way(races[once]):
            yield written(RACE_OFFICIAL, at=now, **of_race(races[once]), once=once)
