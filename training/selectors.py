"""What pages and the API show of training."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from django.db.models import QuerySet

from accounts.quotas import limit_of, used_by
from evaluation.models import TrainedModel
from evaluation.selectors import can_see_model, visible_models

from .cloning import build_of_model
from .models import TrainingJob
from .quotas import MINUTES

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


def trainings_of(racer: Racer | AnonymousUser) -> QuerySet[TrainingJob]:
    """The racer's trainings, newest first, without what only single pages need. Twin of :func:`can_see_training`."""
    return (
        TrainingJob.objects.filter(owner_id=racer.pk, deleted_at=None)
        .select_related("track", "best_model", "last_model")
        .defer("log", "printed", "seen")
    )


def visible_trainings(racer: Racer | AnonymousUser) -> QuerySet[TrainingJob]:
    """All that the racer may look at: their own; for admins all. Twin of :func:`can_see_training`."""
    if racer.is_staff:
        return TrainingJob.objects.filter(deleted_at=None)
    return TrainingJob.objects.filter(owner_id=racer.pk, deleted_at=None)


def can_see_training(racer: Racer | AnonymousUser, job: TrainingJob) -> bool:
    """Whether the racer may look at the training: its owner, or an admin; nobody at a deleted one."""
    return racer.pk is not None and job.deleted_at is None and (racer.pk == job.owner_id or racer.is_staff)


def can_stop_training(racer: Racer | AnonymousUser, job: TrainingJob) -> bool:
    """Whether the racer may stop the training while it waits or runs: its owner, or an admin."""
    return not job.is_final and can_see_training(racer, job)


def can_delete_training(racer: Racer | AnonymousUser, job: TrainingJob) -> bool:
    """Whether the racer may delete the training: its owner, once it is over."""
    return job.is_final and job.deleted_at is None and racer.pk == job.owner_id


def clonable_models(racer: Racer | AnonymousUser) -> QuerySet[TrainedModel]:
    """Models whose weights the racer may begin with: all that they see, which are their own, uploaded ones too, and
    shared ones. Whether the network is one that is trained here shows at :func:`training.services.create_training`.
    Twin of :func:`can_clone_model`."""
    return visible_models(racer)


def house_cars() -> list[TrainedModel]:
    """The house's own models that a training can begin with, by their names: one query."""
    models = TrainedModel.objects.filter(owner__is_house=True, owner__is_active=True, deleted_at=None)
    return [model for model in models.select_related("network").order_by("name", "pk")[:12] if build_of_model(model)][
        :4
    ]


def can_clone_model(racer: Racer | AnonymousUser, model: TrainedModel) -> bool:
    """Whether the racer may begin with the weights of this model."""
    return can_see_model(racer, model)


def minutes_used(racer: Racer, now: datetime) -> float:
    """Minutes of training since the month began, as :mod:`training.quotas` counts them."""
    return used_by(racer, MINUTES.name, now)


def minutes_left(racer: Racer, now: datetime) -> float:
    """Minutes of training that the racer may still ask for this month."""
    return max(0.0, limit_of(racer, MINUTES.name) - minutes_used(racer, now))
