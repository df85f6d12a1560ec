"""What happens in a race, as events, and who may see events of races and runs.

The opening, the coming end and the closing of a race come by the passing of time: the league's clock
(:mod:`league.services.clock`) notices them and writes each once.
"""

from __future__ import annotations

from typing import Any

from django.db.models import Q
from django.utils import timezone

from core.events import Event, EventKind, record, register, register_audience
from evaluation.events import RUN
from evaluation.models import Evaluation

from .models import Race

# Who may see the race.
RACE = "race"
_OF_RACE = ("race", "subject")

RACE_OPENED = register(EventKind("race.opened", "a race has opened", RACE, _OF_RACE, once="race and opening time"))
RACE_CLOSING = register(
    EventKind("race.closing", "a race closes in less than a day", RACE, _OF_RACE, once="race and closing time")
)
RACE_CLOSED = register(EventKind("race.closed", "a race has closed", RACE, _OF_RACE, once="race and closing time"))
RACE_CANCELLED = register(EventKind("race.cancelled", "a race was cancelled", RACE, _OF_RACE, ("reason",)))
RACE_OFFICIAL = register(
    EventKind(
        "race.official", "the results of a race are official", RACE, _OF_RACE, once="race and time of its closing"
    )
)
RACE_RESULT = register(
    EventKind(
        "race.result",
        "a car was timed in a race, and its result counts",
        RUN,
        ("racer", "race", "subject"),
        ("submission",),
        once="run",
    )
)
RACE_TIMED = register(
    EventKind(
        "race.timed",
        "a racer's session with a real car has ended, and its laps count",
        RACE,
        ("racer", "race", "subject"),
        ("session",),
        once="session",
    )
)
RACE_BOARD = register(
    EventKind("race.board", "a board changed by more than a result: somebody left or came back", RACE, _OF_RACE)
)
RACE_RETIMED = register(
    EventKind("race.retimed", "all runs of a race were driven again with another engine", RACE, _OF_RACE, ("engine",))
)
DUELS_DRAWN = register(EventKind("duels.drawn", "the duels of a race are drawn", RACE, _OF_RACE, ("cars",)))
DUEL_DECIDED = register(EventKind("duel.decided", "a heat of a race is decided", RACE, _OF_RACE, ("round", "number")))
DUELS_OVER = register(EventKind("duels.over", "the last heat of a race is decided", RACE, _OF_RACE))

LIVE_PLANNED = register(EventKind("live.planned", "a race is to have a live event", RACE, _OF_RACE))
LIVE_CHANGED = register(
    EventKind("live.changed", "something was done in the live event of a race", RACE, _OF_RACE, ("version",))
)
LIVE_SHOWN = register(
    EventKind("live.shown", "a run of a live event was played to its end", RACE, _OF_RACE, once="run")
)


def of_race(race: Race) -> dict[str, Any]:
    """The columns of an event that names a race: its id and its address."""
    return {"race": race.pk, "subject": race.slug}


def record_board(race: Race) -> None:
    """The board of a race was worked out anew, or somebody left it or came back. Call it in that transaction."""
    record(RACE_BOARD, at=timezone.now(), **of_race(race))


def register_audiences() -> None:
    """Say who may see events of races and of runs: who may see the race or the run."""
    from .selectors.visibility import can_see_evaluation, can_see_race, evaluations_visible_to, races_visible_to

    def sees_race(viewer: Any, event: Event) -> bool:
        race = Race.objects.filter(pk=event.race).first()
        return race is not None and can_see_race(viewer, race)

    def sees_run(viewer: Any, event: Event) -> bool:
        run = Evaluation.objects.filter(public_id=event.subject).first()
        return run is not None and can_see_evaluation(viewer, run)

    register_audience(RACE, can_see=sees_race, seen=lambda viewer: Q(race__in=races_visible_to(viewer).values("pk")))
    register_audience(
        RUN, can_see=sees_run, seen=lambda viewer: Q(subject__in=evaluations_visible_to(viewer).values("public_id"))
    )
