"""Stopping the cars of submissions that have become pointless."""

from __future__ import annotations

from datetime import datetime
from functools import partial

from django.db import transaction
from django.db.models import QuerySet

from evaluation.models import Evaluation, State
from evaluation.services import stop_evaluation

from ..models import Duel, Entry, Submission


def stop_after_commit(submissions: QuerySet[Submission], *, now: datetime) -> None:
    """Stop what waits or drives among ``submissions`` once the current transaction is committed.

    Not before: the lock order is evaluation, entry, race. One that cannot be stopped is logged and simply runs.
    """
    _stop(Evaluation.objects.filter(submission__in=submissions), now)


def stop_duels_after_commit(entry: Entry, *, now: datetime) -> None:
    """Stop the duels that wait or drive with an entry that has left, likewise: they are then driven without it."""
    _stop(Evaluation.objects.filter(duel__in=Duel.objects.filter(cars__entry=entry)), now)


def stop_evaluations_after_commit(evaluations: QuerySet[Evaluation], *, now: datetime) -> None:
    """Stop those of ``evaluations`` that wait or drive, likewise."""
    _stop(evaluations, now)


def _stop(evaluations: QuerySet[Evaluation], now: datetime) -> None:
    for evaluation in evaluations.filter(state__in=(State.QUEUED, State.RUNNING)):
        transaction.on_commit(partial(stop_evaluation, evaluation=evaluation, now=now), robust=True)
