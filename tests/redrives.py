"""Sites whose engine has changed, and runs that are driven again as a test chooses."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from paddock.errors import PaddockError
from races.boards.selectors.board import board
from races.models import Entry, Race, Redrive, RedriveState
from tests import factories
from tests.factories import outcome, start

SITE = "paddock.simulator.engine.ENGINE_ID"


def pending(race: Race) -> list[Redrive]:
    """The runs of a race that are being driven again, in the order of their racers."""
    found = Redrive.objects.filter(submission__entry__race=race, state=RedriveState.PENDING)
    return list(found.select_related("evaluation", "submission__entry__racer").order_by("submission_id"))


def end(redrive: Redrive, driven: Sequence[dict[str, Any]], now: datetime) -> None:
    """Let a run that is driven again come to its end with these laps, by the site's engine."""
    running = start(redrive.evaluation, now)
    assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=outcome(driven), now=now)


def break_down(redrive: Redrive, fault: PaddockError, now: datetime) -> None:
    """Let it fail, as often as it takes until that is final."""
    factories.break_down(Evaluation.objects.get(pk=redrive.evaluation_id), fault, now)


def shown(race: Race) -> list[tuple[str, int | None]]:
    """What everybody sees on the board: who stands there in order, and with what score."""
    return [(row.alias, row.entry.score_ms) for row in board(Race.objects.get(pk=race.pk)).rows]


def everything(race: Race) -> list[dict[str, Any]]:
    """All that the standings of a race hold."""
    return [*Race.objects.filter(pk=race.pk).values(), *Entry.objects.filter(race=race).order_by("pk").values()]
