"""Selectors of the queue: length, positions, expected waits, and permission to stop a run."""

import math
from datetime import datetime, timedelta

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.db.models import Avg, DurationField, ExpressionWrapper, F

from accounts.models import Racer
from core.streams.shared_pieces import shared_value

from ...models import Evaluation, Result, State
from .order import BACKGROUND, FRONT, ORDER, front_of_queue, queued

RECENT = 20  # finished evaluations that the expected wait is reckoned from


def can_stop_evaluation(racer: Racer | AnonymousUser, evaluation: Evaluation) -> bool:
    """Whether the racer may stop the unfinished evaluation: an admin, or its owner unless a rival's car takes part."""
    if evaluation.is_final or racer.pk is None:
        return False
    if racer.is_staff:
        return True
    return racer.pk == evaluation.owner_id and not evaluation.rivals.exclude(model__owner=racer.pk).exists()


def queue_length() -> int:
    """The number of waiting evaluations without background ones; ``FRONT + 1`` for more than ``FRONT``."""
    return queued().filter(priority__gt=BACKGROUND).order_by(*ORDER)[: FRONT + 1].count()


def waiting_since() -> datetime | None:
    """Since when the evaluation waits that was queued first, of those that somebody waits for."""
    waiting = queued().filter(priority__gt=BACKGROUND).order_by("queued_at")
    return waiting.values_list("queued_at", flat=True).first()


def queue_position(evaluation: Evaluation) -> int | None:
    """The place in the queue, 1 for the next one to run; None when it does not wait. ``FRONT + 1`` stands for every
    place behind ``FRONT``."""
    if evaluation.state != State.QUEUED:
        return None
    front = shared_value("front of queue", front_of_queue)
    if evaluation.pk in front:
        return front.index(evaluation.pk) + 1
    still = len(front) == FRONT and queued().filter(pk=evaluation.pk).exists()
    return FRONT + 1 if still else None


def expected_wait_s(evaluation: Evaluation, position: int | None = None) -> float | None:
    """Seconds until a waiting evaluation has probably ended, from the last runs; None without any. Behind ``FRONT``,
    the least wait. ``position`` saves looking it up again."""
    position = position or queue_position(evaluation)
    if position is None:
        return None
    mean = shared_value("mean run", _mean_run)
    return None if mean is None else mean.total_seconds() * math.ceil(position / settings.WORKER_CONCURRENCY)


def _mean_run() -> timedelta | None:
    """The mean duration of the last :data:`RECENT` runs."""
    took = ExpressionWrapper(F("evaluation__ended_at") - F("evaluation__started_at"), output_field=DurationField())
    # The last rows first, and then without the sealed ones: in one, SQLite may join all runs before it looks for them
    recent = list(Result.with_sealed.order_by("-pk").values_list("pk", flat=True)[:RECENT])
    return Result.objects.filter(pk__in=recent).aggregate(mean=Avg(took))["mean"]
