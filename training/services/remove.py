"""Deleting a training that is over."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.db import transaction

from core.times import start_of_month
from evaluation.models import Evaluation, State, TrainedModel
from evaluation.services import delete_model
from paddock.errors import UserFault
from races.models import Submission

from ..models import TrainingJob
from ..models.choices import FINAL_STATES
from ..quotas import bytes_of, files_of
from .records import delete_stored

_NOTHING: dict[str, Any] = {
    "name": "deleted",
    "description": "",
    "reward_code": "# deleted\n",
    "log": "",
    "printed": "",
    "driving": [],
    "progress": {},
    "seen": {},
    "operator_detail": "",
    "sb3_zip": "",
    "best_model": None,
    "last_model": None,
    "submission": None,
    "submit_to_race": None,
    "own_evaluation": None,
    "evaluate_on": None,
}


@transaction.atomic
def delete_training(*, job: TrainingJob, with_models: bool = False, now: datetime) -> int:
    """Delete a training with its files, graph, log and reward function. How many bytes its files had.

    Its models stay in the garage; ``with_models``: :func:`evaluation.services.delete_model` deletes them, too, and
    networks that results need stay. A row without content stays until its month is over, for its minutes count.

    Raises UserFault ``training_under_way`` for one that is not over, ``training_model_races`` for models that are in a
    race that is not over, ``training_model_drives`` for those of a run that waits or is driven.
    """
    models = models_of(job) if with_models else []
    _refuse_racing(models, now)
    names, weight = files_of(job), bytes_of(job)
    over = TrainingJob.objects.filter(pk=job.pk, state__in=FINAL_STATES, deleted_at=None)
    if not over.update(deleted_at=now, **_NOTHING):
        raise UserFault("training_under_way")
    for model in models:
        delete_model(model=model, now=now)
    job.iterations.all().delete()
    job.checkpoints.all().delete()
    transaction.on_commit(lambda: delete_stored(names), robust=True)
    return weight


def models_of(job: TrainingJob) -> list[TrainedModel]:
    """Its models that are in the garage: none, one or two."""
    wanted = [pk for pk in (job.best_model_id, job.last_model_id) if pk is not None]
    return list(TrainedModel.objects.filter(pk__in=wanted, deleted_at=None).order_by("pk"))


def forget_deleted(*, now: datetime) -> int:
    """Remove the rows of deleted trainings whose minutes count no more. How many."""
    month = start_of_month(now)
    return TrainingJob.objects.filter(deleted_at__isnull=False, created_at__lt=month).delete()[0]


def _refuse_racing(models: list[TrainedModel], now: datetime) -> None:
    for model in models:
        entered = Submission.objects.filter(evaluation__model=model, is_void=False)
        race = entered.filter(entry__race__closes_at__gt=now, entry__race__cancelled_at=None).first()
        if race is not None:
            raise UserFault("training_model_races", name=model.name, race=race.entry.race.name)
        # its owner's: what others drive with a shared car keeps nobody from deleting it
        driven = Evaluation.objects.filter(model=model, owner=model.owner_id, state__in=(State.QUEUED, State.RUNNING))
        if driven.exists():
            raise UserFault("training_model_drives", name=model.name)
