"""What pages and the API show of models and of the queue."""

from __future__ import annotations

import math
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from django.conf import settings
from django.db.models import Avg, DurationField, ExpressionWrapper, F, Q, QuerySet

from .models import Evaluation, Result, State, TrainedModel
from .queue_order import BACKGROUND, FRONT, ORDER, front_of_queue, queued

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

RECENT = 20  # finished evaluations that the expected wait is reckoned from
# A deactivated racer shares nothing, and what drives for the house belongs to everybody.
_SHARED = Q(Q(shared_at__isnull=False) | Q(owner__is_house=True), owner__is_active=True, deleted_at=None)


def models_of(racer: Racer | AnonymousUser) -> QuerySet[TrainedModel]:
    """The racer's garage, newest first; empty for somebody who is not logged in. Twin of :func:`can_use_model`."""
    return TrainedModel.objects.filter(owner_id=racer.pk, deleted_at=None).select_related("network", "owner")


def can_use_model(racer: Racer | AnonymousUser, model: TrainedModel) -> bool:
    """Whether the racer may see, change, race and delete the model: it is theirs and not deleted."""
    return racer.pk is not None and model.owner_id == racer.pk and model.deleted_at is None


def visible_models(racer: Racer | AnonymousUser) -> QuerySet[TrainedModel]:
    """Models that the racer may look at, download and train on from: their own, and what others share. Twin of
    :func:`can_see_model`. Admins see what others see; the admin site shows them the rest."""
    models = TrainedModel.objects.select_related("network", "owner")
    if racer.pk is None:
        return models.none()
    return models.filter(_SHARED | Q(owner_id=racer.pk, deleted_at=None))


def can_see_model(racer: Racer | AnonymousUser, model: TrainedModel) -> bool:
    """Whether the racer may look at the model, download it and train on from it: it is theirs, or shared."""
    return racer.pk is not None and (can_use_model(racer, model) or is_shared(model))


def shared_models(racer: Racer | AnonymousUser) -> QuerySet[TrainedModel]:
    """What racers share and the house's cars, the latest first; nothing for somebody who is not logged in. Twin of
    :func:`is_shared`."""
    models = TrainedModel.objects.select_related("network", "owner")
    if racer.pk is None:
        return models.none()
    return models.filter(_SHARED).order_by(F("shared_at").desc(nulls_last=True), "-pk")


def is_shared(model: TrainedModel) -> bool:
    """Whether every racer may look at the model, download it and train on from it."""
    owner = model.owner
    return model.deleted_at is None and owner.is_active and (model.shared_at is not None or owner.is_house)


def can_stop_sharing(racer: Racer | AnonymousUser, model: TrainedModel) -> bool:
    """Whether the racer may end the sharing of a model: its owner, or an admin."""
    return racer.pk is not None and model.shared_at is not None and (racer.pk == model.owner_id or racer.is_staff)


def can_stop_evaluation(racer: Racer | AnonymousUser, evaluation: Evaluation) -> bool:
    """Whether the racer may stop the evaluation while it waits or runs: an admin, or its owner.

    An owner who races somebody else's car may not: the duel is the other's as well.
    """
    if evaluation.is_final or racer.pk is None:
        return False
    if racer.is_staff:
        return True
    return racer.pk == evaluation.owner_id and not evaluation.rivals.exclude(model__owner=racer.pk).exists()


def queue_length() -> int:
    """How many evaluations wait that somebody waits for; ``FRONT + 1`` says that there are more than ``FRONT``."""
    return queued().filter(priority__gt=BACKGROUND).order_by(*ORDER)[: FRONT + 1].count()


def waiting_since() -> datetime | None:
    """Since when the evaluation waits that was queued first, of those that somebody waits for."""
    waiting = queued().filter(priority__gt=BACKGROUND).order_by("queued_at")
    return waiting.values_list("queued_at", flat=True).first()


def queue_position(evaluation: Evaluation) -> int | None:
    """The place in the queue, 1 for the next one to run; None when it does not wait.

    Exact up to ``FRONT``; ``FRONT + 1`` stands for every place behind: counting those would cost all the more the
    longer the queue is, and each page that waits asks every second.
    """
    if evaluation.state != State.QUEUED:
        return None
    front = front_of_queue()
    if evaluation.pk in front:
        return front.index(evaluation.pk) + 1
    still = len(front) == FRONT and queued().filter(pk=evaluation.pk).exists()
    return FRONT + 1 if still else None


def expected_wait_s(evaluation: Evaluation, position: int | None = None) -> float | None:
    """Seconds until a waiting evaluation has probably ended, from the last runs; None without any to judge by. Behind
    ``FRONT``, how long it waits at least.

    ``position`` saves looking it up again.
    """
    position = position or queue_position(evaluation)
    if position is None:
        return None
    took = ExpressionWrapper(F("evaluation__ended_at") - F("evaluation__started_at"), output_field=DurationField())
    # The last rows first, and then without the sealed ones: in one, SQLite may join all runs before it looks for them
    recent = list(Result.with_sealed.order_by("-pk").values_list("pk", flat=True)[:RECENT])
    mean: timedelta | None = Result.objects.filter(pk__in=recent).aggregate(mean=Avg(took))["mean"]
    if mean is None:
        return None
    return mean.total_seconds() * math.ceil(position / settings.WORKER_CONCURRENCY)
