"""Evaluations as the operators' page sees them."""

from datetime import datetime

from django.db.models import QuerySet
from django.utils.translation import gettext_lazy as _

from core.jobs.queues import Queue, register_queue
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.services import queue_again

from ..models import Submission
from .services.submissions import repeat_submission


def register() -> None:
    register_queue(
        Queue(
            *("evaluations", _("Evaluations"), EVALUATIONS),
            related=("owner", "model", "track"),
            repeatable=_evaluations,
            run_again=_evaluate_again,
        )
    )


def _evaluations(failed: QuerySet[Evaluation]) -> QuerySet[Evaluation]:
    """Without heats and reruns, which are requeued automatically, and without runs repeated already."""
    return failed.filter(duel=None, redrive=None).exclude(submission__is_void=True)


def _evaluate_again(evaluation: Evaluation, now: datetime) -> object:
    submission = Submission.objects.filter(evaluation=evaluation).select_related("entry").first()
    if submission is None:
        return queue_again(evaluation=evaluation)
    return repeat_submission(submission=submission, now=now)
