"""Stopping the cars of submissions that have become pointless."""

from __future__ import annotations

from datetime import datetime

from django.db import transaction
from django.db.models import QuerySet

from evaluation.models import Evaluation, State
from evaluation.services import stop_evaluation

from ..models import Submission


def stop_after_commit(submissions: QuerySet[Submission], *, now: datetime) -> None:
    """Stop what waits or drives among ``submissions`` once the current transaction is committed.

    Not before: the lock order is evaluation, entry, race. One that cannot be stopped is logged and simply runs.
    """
    active = Evaluation.objects.filter(submission__in=submissions, state__in=(State.QUEUED, State.RUNNING))
    for evaluation in active:
        transaction.on_commit(lambda one=evaluation: stop_evaluation(evaluation=one, now=now), robust=True)
