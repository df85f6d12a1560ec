"""Races of real cars for tests: a race, and sessions as a timekeeper's device sends them."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import cycle
from typing import Any

from accounts.models import Racer
from races.entries.services.entries import enter_race
from races.models import Entry, Guest, Race, TimedSession
from races.timing.services import SentLap, SentSession, carry_over, correct_lap, make_sensor, name_timekeeper
from tests.factories import a_race

_MINUTES = cycle(range(50))


def a_physical_race(now: datetime, **fields: Any) -> Race:
    """A public race of real cars, ranked by the best lap, whose off tracks cost a second."""
    usual = {"physical": True, "ranking_method": "best", "minimum_laps": 1, "off_track_penalty_ms": 1000}
    return a_race(now, **(usual | fields))


def a_lap(number: int, time_ms: int = 10_000, **fields: Any) -> SentLap:
    """One lap as it is sent."""
    return SentLap(id=uuid.uuid4(), number=number, time_ms=time_ms, **fields)


def a_session(now: datetime, *times: int, laps: Sequence[SentLap] | None = None, **fields: Any) -> SentSession:
    """An ended session that began within the hour before ``now``, each at another minute."""
    driven = [a_lap(number, time) for number, time in enumerate(times, 1)] if laps is None else laps
    usual = {
        "id": uuid.uuid4(),
        "revision": 1,
        "started_at": now - timedelta(minutes=55 - next(_MINUTES)),
        "ended": True,
    }
    return SentSession(**(usual | fields | {"laps": driven}))


def timed(race: Race, racer: Racer, by: Racer, now: datetime, *times: int, **fields: Any) -> TimedSession:
    """A session of a racer, whom this enters, carried over."""
    enter_race(race=race, racer=racer, now=now)
    session = carry_over(race=race, by=by, sent=a_session(now, *times, racer=racer.alias, **fields), now=now)
    assert session is not None
    return session


def standing(race: Race, racer: Racer) -> tuple:
    """What a racer is ranked by: whether classified, score, best and average lap, off tracks."""
    names = ("classified", "score_ms", "best_lap_ms", "average_ms", "off_tracks")
    return Entry.objects.values_list(*names).get(race=race, racer=racer)


def a_timed_race(now: datetime, organiser: Racer, racer: Racer, **fields: Any) -> tuple[Race, Guest]:
    """A race of real cars in which much has happened: two racers timed, a guest, a correction, a sensor, a
    timekeeper."""
    usual = {"slug": "real-race", "name": "Real race", "organiser": organiser, "max_resets": 3}
    race = a_physical_race(now, **(usual | fields))
    timed(race, organiser, organiser, now, 12_000, 11_500, car="Car 7")
    lap = timed(race, racer, organiser, now, 10_000, 11_000).laps.get(number=1)
    correct_lap(lap=lap, by=organiser, reason="Cut the corner", now=now, off_tracks=1)
    id = uuid.uuid4()
    carry_over(race=race, by=organiser, sent=a_session(now, 13_000, guest=(id, "Mia Guest")), now=now)
    name_timekeeper(race=race, alias=racer.alias, by=organiser, now=now)
    make_sensor(race=race, name="Gate", by=organiser, now=now)
    return race, Guest.objects.get(pk=id)
