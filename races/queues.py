"""Evaluations as the operators' page sees them."""

from __future__ import annotations

from datetime import datetime

from django.db.models import QuerySet
from django.utils.translation import gettext_lazy as _

from core.jobs.queues import Queue, register_queue
from evaluation.models import Evaluation
from evaluation.services import EVALUATIONS, queue_again

from .models import Submission
from .services import repeat_submission


def register() -> None:
    """Register them."""
    register_queue(
        Queue(
            *("evaluations", _("Evaluations"), EVALUATIONS),
            since="queued_at",
            related=("owner", "model", "track"),
            repeatable=_evaluations,
            run_again=_evaluate_again,
        )
    )


def _evaluations(failed: QuerySet[Evaluation]) -> QuerySet[Evaluation]:
    """Without heats of duels and runs of races that are driven again, which both are queued anew by themselves, and
    without what was run again already."""
    return failed.filter(duel=None, redrive=None).exclude(submission__is_void=True)


def _evaluate_again(evaluation: Evaluation, now: datetime) -> object:
    submission = Submission.objects.filter(evaluation=evaluation).select_related("entry").first()
    if submission is None:
        return queue_again(evaluation=evaluation)
    return repeat_submission(submission=submission, now=now)
