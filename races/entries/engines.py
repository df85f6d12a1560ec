"""A race has one engine, that of its counted results (:mod:`races.entries.services.redrives` changes it)."""

from collections.abc import Callable
from datetime import datetime

from django.db.models import Exists, OuterRef

from evaluation.models import Evaluation, State
from paddock.simulator import engine as simulator

from ..models import Draw, LiveEvent, Opponents, Race, RaceState, Redrive, RedriveState, Submission
from ..models.live import OVER

# Checks of higher rooms, which add them when the site starts: whether a race's results are official, so that its
# board is final, and whether they can no longer be corrected.
OFFICIAL_CHECKS: list[Callable[[Race], bool]] = []
FINAL_CHECKS: list[Callable[[Race, datetime], bool]] = []


def is_official(race: Race) -> bool:
    """Whether the results of a race are official by any check of a higher room."""
    return any(check(race) for check in OFFICIAL_CHECKS)


def is_final(race: Race, now: datetime) -> bool:
    """Whether corrections of a race's results have ended by any check of a higher room."""
    return any(check(race, now) for check in FINAL_CHECKS)


def site_engine() -> str:
    return simulator.ENGINE_ID


def keeps_engine(race: Race) -> bool:
    """Whether a new result would count at once: no reruns, and no result yet or one of the same engine."""
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
    """Whether a result of ``engine`` counts in ``race``, locked by the caller. The first result sets the race's engine;
    one of another engine is held back and the race marked for reruns."""
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
