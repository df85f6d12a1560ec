"""Assigns turns in the queue (:mod:`.order`) and moves evaluations of a race forward, to the priority ``URGENT``, in
the hour before it closes."""

import logging
from collections.abc import Sequence
from datetime import datetime, timedelta

from django.db import IntegrityError, transaction
from django.db.models import QuerySet

from ...models import Evaluation
from .order import URGENT, next_turns, queued

logger = logging.getLogger(__name__)
HURRY = timedelta(hours=1)
AT_ONCE = 500  # moved by one sweep
TRIES = 5


def insert_in_turn(evaluations: Sequence[Evaluation]) -> None:
    """Insert evaluations of one priority with their turns, in order; a turn that was taken meanwhile is replaced by the
    next. Raises IntegrityError for anything else, and after :data:`TRIES`."""
    # one order for all transactions that insert several rows, which prevents a deadlock
    for left in reversed(range(TRIES)):
        turns = next_turns([one.owner_id for one in evaluations], evaluations[0].priority)
        for one, turn in zip(evaluations, turns, strict=True):
            one.turn = turn
        try:
            with transaction.atomic():
                Evaluation.objects.bulk_create(evaluations)
            return
        except IntegrityError:
            if not left:
                raise


def put_in_turn(*, now: datetime) -> None:
    """For the sweep: move what has become urgent, and give turns to rows queued without one (by an older version)."""
    hurried = queued().filter(urgent_from__lte=now).order_by("turn", "queued_at", "pk")
    _move(hurried, {"urgent_from__isnull": False}, URGENT)
    without = queued().filter(turn=None)
    for priority in list(without.values_list("priority", flat=True).distinct()):
        _move(without.filter(priority=priority).order_by("queued_at", "pk"), {"turn": None}, priority)


def hurry_from(closes_at: datetime) -> datetime:
    return closes_at - HURRY


def reschedule(*, evaluations: QuerySet[Evaluation], closes_at: datetime) -> None:
    """Their race closes at another time: those that wait and do not hurry yet (a queryset) begin to by that."""
    evaluations.filter(pk__in=queued().filter(urgent_from__isnull=False)).update(urgent_from=hurry_from(closes_at))


def _move(rows: QuerySet[Evaluation], unless_moved: dict, priority: int) -> None:
    found = list(rows[:AT_ONCE])
    if not found:
        return
    turns = next_turns([one.owner_id for one in found], priority)
    for one, turn in zip(found, turns, strict=True):
        one.priority, one.turn, one.urgent_from = priority, turn, None if priority == URGENT else one.urgent_from
    try:
        with transaction.atomic():
            queued().filter(**unless_moved).bulk_update(found, ["priority", "turn", "urgent_from"])
    except IntegrityError:  # a racer has queued something meanwhile
        logger.info("%s evaluations get their turns with the next sweep.", len(found))
