"""Events of a race. The league's clock (:mod:`league.seasons.services.clock`) records openings and closings."""

from typing import TypedDict

from django.utils import timezone

from core.events import EventKind, record, register

from .models import Race


def _kind(name: str, summary: str, data: tuple[str, ...] = (), *, once: str = "") -> EventKind:
    return register(EventKind(name, summary, ("race", "subject"), data, once))


RACE_OPENED = _kind("race.opened", "a race has opened", once="race and opening time")
RACE_CLOSING = _kind("race.closing", "a race closes in less than a day", once="race and closing time")
RACE_CLOSED = _kind("race.closed", "a race has closed", once="race and closing time")
RACE_CANCELLED = _kind("race.cancelled", "a race was cancelled", ("reason",))
RACE_OFFICIAL = _kind("race.official", "the results of a race are official", once="race and time of its closing")
RACE_BOARD = _kind("race.board", "a board changed by more than a result: an entry was removed or restored")
RACE_RETIMED = _kind("race.retimed", "all runs of a race were driven again with another engine", ("engine",))
DUELS_DRAWN = _kind("duels.drawn", "the duels of a race are drawn", ("cars",))
DUEL_DECIDED = _kind("duel.decided", "a heat of a race is decided", ("round", "number"))
DUELS_OVER = _kind("duels.over", "the last heat of a race is decided")
LIVE_PLANNED = _kind("live.planned", "a live event of a race is planned")
LIVE_CHANGED = _kind("live.changed", "the live event of a race changed", ("version",))
LIVE_SHOWN = _kind("live.shown", "a run of a live event was played to its end", once="run")

_OF_RACER = ("racer", "race", "subject")
RACE_RESULT = register(
    EventKind("race.result", "a car was timed in a race, and its result counts", _OF_RACER, ("submission",), once="run")
)
_TIMED = "a racer's session with a real car has ended, and its laps count"
RACE_TIMED = register(EventKind("race.timed", _TIMED, _OF_RACER, ("session",), once="session"))

RESULT_DIFFERS = register(
    EventKind(
        "result.differs",
        "an official result was driven again and came to something else; for admins",
        ("subject",),
        ("recheck",),
    )
)


class RaceColumns(TypedDict):
    race: int
    subject: str


def of_race(race: Race) -> RaceColumns:
    """The columns of an event that names a race: its id and its address."""
    return {"race": race.pk, "subject": race.slug}


def record_board(race: Race) -> None:
    """The board of a race was recomputed, or a racer left or came back. Call it in that transaction."""
    record(RACE_BOARD, at=timezone.now(), **of_race(race))
