"""Deletes finished trainings, and stored files of trainings."""

import logging
from datetime import datetime

from django.db import transaction
from django.db.models import QuerySet
from django.utils.translation import gettext_lazy as _

from core.audit.recording import audited
from core.times import start_of_month
from evaluation.garage.services import delete_model
from evaluation.models import Evaluation, State, TrainedModel
from evaluation.stored_files import delete
from paddock.errors import UserFault
from races.models import Submission

from ...models import Checkpoint, SweepTrial, TrainingJob
from ...models.choices import FINAL_STATES
from ...quotas import bytes_of, files_of

_NOTHING: dict[str, object] = {
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


@audited("training.deleted", _("Training deleted"), target="job", unless="owner")
@transaction.atomic
def delete_training(*, job: TrainingJob, with_models: bool = False, now: datetime) -> int:
    """Delete a training with its files, graph, log and reward function; the bytes of its files.

    ``with_models``: its models as well, but for networks that results need. The row stays until its month is over, for
    its minutes count. Raises UserFault ``training_under_way``, ``training_of_sweep``, ``training_model_races``,
    ``training_model_drives``.
    """
    if SweepTrial.objects.filter(job=job).exists():
        raise UserFault("training_of_sweep")
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


logger = logging.getLogger(__name__)


def files_of_checkpoints(checkpoints: QuerySet[Checkpoint]) -> list[str]:
    return [name for names in checkpoints.values_list("file", "networks") for name in names if name]


def drop_checkpoints(job: TrainingJob) -> None:
    mine = Checkpoint.objects.filter(job=job)
    names = files_of_checkpoints(mine)
    mine.delete()
    transaction.on_commit(lambda: delete_stored(names), robust=True)


def delete_stored(names: list[str]) -> None:
    for name in filter(None, names):
        try:
            delete(name)
        except Exception as error:  # each storage raises other classes
            logger.warning("The stored file %s could not be deleted: %s", name, error)
