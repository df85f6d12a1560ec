"""A race has one engine, that of its counted results: what that asks of a result that comes in. How a race gets from
one engine to another is in :mod:`races.services.redrives`."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime

from django.db.models import Exists, OuterRef

from evaluation.models import Evaluation, State
from paddock.simulator import engine as simulator

from .models import Draw, LiveEvent, Opponents, Race, RaceState, Redrive, RedriveState, Submission
from .models.live import OVER

# Whether the results of a race are official, as a room above says: its board then stands for ever.
OfficialCheck = Callable[[Race], bool]
_OFFICIAL: list[OfficialCheck] = []


def register_official(check: OfficialCheck) -> OfficialCheck:
    """Ask ``check`` too whether a race is official. Registering one twice changes nothing."""
    if check not in _OFFICIAL:
        _OFFICIAL.append(check)
    return check


def is_official(race: Race) -> bool:
    """Whether a room above says that the results of a race are official."""
    return any(check(race) for check in _OFFICIAL)


# Whether the results of a race can no longer be corrected, as a room above says.
FinalCheck = Callable[[Race, datetime], bool]
_FINAL: list[FinalCheck] = []


def register_final(check: FinalCheck) -> FinalCheck:
    """Ask ``check`` too whether a race's results are final. Registering one twice changes nothing."""
    if check not in _FINAL:
        _FINAL.append(check)
    return check


def is_final(race: Race, now: datetime) -> bool:
    """Whether a room above says that nobody may correct the results of a race any more."""
    return any(check(race, now) for check in _FINAL)


def site_engine() -> str:
    """The engine that drives here now."""
    return simulator.ENGINE_ID


def keeps_engine(race: Race) -> bool:
    """Whether what is driven now would count in a race at once: nobody has a result there yet, or it is of the same
    engine, and nothing is being driven again."""
    return not race.next_engine and race.engine in ("", site_engine())


def is_over(race: Race, now: datetime) -> bool:
    """Whether nothing that was sent in time can change the board of a race any more, so that it keeps its engine."""
    if race.cancelled_at is not None or race.imported_at is not None or is_official(race):
        return True
    if race.state_at(now) != RaceState.CLOSED or race.next_engine:
        return False
    if race.opponents == Opponents.MODELS and not Draw.objects.filter(race=race, over_at__isnull=False).exists():
        return False
    if LiveEvent.objects.filter(race=race).exclude(state__in=OVER).exists():
        return False
    return not Submission.objects.filter(entry__race=race, evaluation__state__in=(State.QUEUED, State.RUNNING)).exists()


def admit(race: Race, engine: str) -> bool:
    """Whether a result of ``engine`` counts in ``race`` at once; the caller has locked the race.

    The first result gives the race its engine. One of another engine is held back, and the race marked, so that its
    runs are driven again and then count together.
    """
    if not race.engine:
        race.engine = engine
        Race.objects.filter(pk=race.pk).update(engine=engine)
    elif race.engine != engine and not race.next_engine:
        race.next_engine = site_engine()
        Race.objects.filter(pk=race.pk).update(next_engine=race.next_engine)
    return race.engine == engine


def hidden_runs() -> Exists:
    """Of an evaluation: that it was driven again and its race has not taken it, so that it is for operators alone."""
    return Exists(Redrive.objects.filter(evaluation=OuterRef("pk")).exclude(state=RedriveState.TAKEN))


def is_hidden(evaluation: Evaluation) -> bool:
    """:func:`hidden_runs` of one evaluation."""
    return Redrive.objects.filter(evaluation=evaluation).exclude(state=RedriveState.TAKEN).exists()
