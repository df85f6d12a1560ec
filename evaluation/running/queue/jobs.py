"""The queue of evaluations (:mod:`core.jobs`): what is theirs of it, and how one ends that was run."""

from __future__ import annotations

import uuid
from datetime import datetime
from typing import TYPE_CHECKING

from django.db import transaction
from django.db.models import Q, QuerySet

from core.database.kept_queries import KeptQuery
from core.jobs.kinds import register
from core.jobs.retried import RetriedKind

from ...models import Evaluation, Result, State
from ...signals import evaluation_ended
from ..events import record_end, record_start
from ..results import delete_files, file_names, store_files, write_result
from .order import BACKGROUND, ORDER, queued
from .turns import put_in_turn

if TYPE_CHECKING:
    from ..pipeline import EvaluationOutcome


class Evaluations(RetriedKind[Evaluation]):
    """In the order of :mod:`evaluation.running.queue.order`. Only a car whose simulator ended
    ``EVALUATION_MAX_ATTEMPTS`` times, while others passed in between, fails with ``platform_gave_up``."""

    name, model, task, queue = "Evaluation", Evaluation, "evaluation.tasks.work", "celery"
    order, since, awaited = ORDER, "queued_at", Q(priority__gt=BACKGROUND)
    related = ("model__network", "track")
    blank = {"progress": {}}
    wakes = 8
    # the simulator's process ended under a car, and its worker lived to tell
    alone = frozenset(("runner_died", "runner_error", "runner_protocol", "runner_timeout"))
    gave_up_code, lost_code = "platform_gave_up", "lease_expired"
    storage_counts = True

    def due(self, now: datetime) -> QuerySet[Evaluation]:
        return queued().filter(not_before=None)  # an index has no more: see prepare()

    def prepare(self, now: datetime) -> None:
        over = queued().filter(not_before__lte=now)
        if over.exists():  # an update that changes nothing would still wait for the one who writes
            over.update(not_before=None)

    def tidy(self, now: datetime) -> None:
        put_in_turn(now=now)

    def began(self, job: Evaluation, now: datetime) -> None:
        record_start(job, now)

    def topics(self, job: Evaluation) -> tuple[str, ...]:
        return (f"run:{job.public_id}",)

    def others_passed(self, job: Evaluation) -> bool:
        """Another car: the same network in another garage ends like this one."""
        passed = Result.objects.exclude(evaluation__model__network=job.model.network_id)
        return passed.filter(evaluation__ended_at__gte=job.failed_at or job.queued_at).exists()

    def gave_up(self, job: Evaluation, now: datetime) -> None:
        tell_end(job.pk, None, now)

    def clean_up(self, job: Evaluation) -> None:
        delete_files(file_names(job))  # left behind if the worker died between storing and committing


EVALUATIONS = register(Evaluations())


def finish_evaluation(*, pk: int, lease: uuid.UUID, outcome: EvaluationOutcome, now: datetime) -> bool:
    """Write the result, once, with everything that receivers of ``evaluation_ended`` write. False: the lease is gone.
    The files are stored before the transaction, and deleted when it fails."""
    evaluation = EVALUATIONS.held(pk, lease).first()
    if evaluation is None:
        return False
    files = store_files(evaluation, outcome)
    finished = False
    try:
        with transaction.atomic():
            ended = EVALUATIONS.end(
                EVALUATIONS.held(pk, lease), state=State.FINISHED, now=now, reason_code="", reason_params={}
            )
            if ended:
                tell_end(pk, write_result(pk, lease, outcome, files, now), now)
        finished = ended
    finally:
        if not finished:
            files.delete()
    return finished


_ended: KeptQuery[Evaluation] = KeptQuery(
    lambda pk: Evaluation.with_sealed.filter(pk=pk).select_related("model", "track", "owner")
)


def tell_end(pk: int, result: Result | None, now: datetime) -> None:
    """Announce an end to the rooms above, in its transaction. The end of a sealed run goes to nobody else."""
    (evaluation,) = _ended(pk=pk)
    record_end(evaluation, result, now)
    evaluation_ended.send(sender=Evaluation, evaluation=evaluation, result=result, now=now)
