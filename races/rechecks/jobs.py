"""The queue of rechecks (:mod:`core.jobs`): behind everything else, and as far from the first run as can be."""

import logging
import uuid
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from django.conf import settings
from django.db import transaction
from django.db.models import QuerySet

from core.database.clock import database_now
from core.events import record
from core.jobs.heartbeat import Heartbeat
from core.jobs.holds import hold_of, holds_by_worker
from core.jobs.kinds import CANDIDATES, register
from core.jobs.outages import is_out
from core.jobs.retried import RetriedKind
from core.jobs.work import never, run_next
from evaluation.models import WorkerNode
from evaluation.reports.jobs import CHUNKS
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.worker import job_of
from evaluation.running.worker_nodes import SILENT_AFTER
from paddock.errors import UserFault

from ..entries.engines import site_engine
from ..events import RESULT_DIFFERS
from ..models import Elsewhere, Recheck, RecheckState
from .comparison import VERSION, differing

if TYPE_CHECKING:
    from evaluation.running.pipeline import EvaluationOutcome

logger = logging.getLogger(__name__)
PATIENCE = timedelta(hours=1)  # after it any worker will do
KEPT = timedelta(days=2)  # what was not driven by then is given up
FARTHEST_FIRST = (Elsewhere.PROCESSOR, Elsewhere.MACHINE, Elsewhere.WORKER, Elsewhere.SAME)


class Rechecks(RetriedKind[Recheck]):
    """Rechecks run when nothing else waits. A worker leaves one to those that are farther from its first run, for an
    hour; one that was not driven for two days is given up."""

    name, model, task, queue = "Recheck", Recheck, "races.tasks.recheck", "celery"
    order, since = ("day", "number"), "queued_at"
    related = ("evaluation__model__network", "evaluation__track", "evaluation__result")
    blank = {"differences": {}}
    wakes = 8
    gave_up_code, lost_code = "platform_gave_up", "lease_expired"
    storage_counts = True

    def due(self, now: datetime) -> QuerySet[Recheck]:
        return self.free(now).filter(evaluation__result__engine=site_engine())

    def claim(self, *, worker: str, now: datetime) -> Recheck | None:
        if is_out(*self.needs) or hold_of(worker[:128]) or EVALUATIONS.due(now).exists() or CHUNKS.due(now).exists():
            return None
        waiting = self.due(now).select_related("evaluation__result").order_by(*self.order)[:CANDIDATES]
        nodes = _nodes_at_work(now) if waiting else {}
        for job in waiting:
            if _suits(job, worker, nodes, now) and (taken := self.take(job.pk, job.attempt, worker=worker, now=now)):
                return taken
        return None

    def tidy(self, now: datetime) -> None:
        """Give up what nobody could drive, for example because the site has another engine by now."""
        late = self.model.objects.filter(state=self.waiting, queued_at__lt=now - KEPT)
        if late.exists():
            self.end(late, state=self.failed, now=now, reason_code="recheck_late")


RECHECKS = register(Rechecks())


def run_next_recheck(*, worker: str, interrupted: Callable[[], bool] = never) -> bool:
    """Drive the next recheck to its end. False: none is for this worker, or other runs go before it."""

    def run(job: Recheck, heartbeat: Heartbeat) -> bool:
        from evaluation.running.pipeline import evaluate

        outcome = None
        try:
            outcome = evaluate(
                job_of(job.evaluation),
                should_stop=lambda: heartbeat.lost or interrupted(),
                wall_limit_s=settings.EVALUATION_WALL_SECONDS,
            )
            found = differing(job.evaluation.result, outcome)
            # a newer library alone is no other result, and would raise the alarm for every one of its sample
            differences = {name: pair for name, pair in found.items() if not name.startswith(VERSION)}
        except UserFault as fault:
            if heartbeat.lost or interrupted():
                raise
            differences = {"end": ("finished", fault.code)}
        return finish_recheck(job=job, outcome=outcome, differences=differences, now=database_now())

    return run_next(RECHECKS, run, worker=worker, interrupted=interrupted)


@transaction.atomic
def finish_recheck(
    *, job: Recheck, outcome: "EvaluationOutcome | None", differences: Mapping[str, tuple[Any, Any]], now: datetime
) -> bool:
    """Write the verdict, once, and the alarm where it differs. False: the lease is gone."""
    assert isinstance(job.lease, uuid.UUID), "it was claimed"
    first = job.evaluation.result
    cpu = outcome.cpu_model if outcome else ""
    columns = {
        "same": not differences,
        "differences": {name: list(pair) for name, pair in differences.items()},
        "measured_sha256": outcome.trace_sha256 if outcome else "",
        "measured_engine": outcome.engine if outcome else "",
        "measured_cpu": cpu,
        "elsewhere": distance(job.evaluation.worker, first.cpu_model, job.worker, cpu),
        "reason_code": "",
        "reason_params": {},
    }
    if not RECHECKS.end(RECHECKS.held(job.pk, job.lease), state=RecheckState.FINISHED, now=now, **columns):
        return False
    if differences:
        logger.error("Evaluation %s was driven again and differs: %s.", job.evaluation, ", ".join(differences))
        record(RESULT_DIFFERS, at=now, subject=job.evaluation.public_id, recheck=job.pk)
    return True


def distance(first: str, first_cpu: str, second: str, second_cpu: str) -> Elsewhere:
    """How far two workers are apart, by their names and processors."""
    if first_cpu and second_cpu and first_cpu != second_cpu:
        return Elsewhere.PROCESSOR
    if first.rpartition("@")[2] != second.rpartition("@")[2]:
        return Elsewhere.MACHINE
    return Elsewhere.SAME if first == second else Elsewhere.WORKER


def _nodes_at_work(now: datetime) -> dict[str, str]:
    """The processor of each worker that might take a recheck, by name."""
    held = holds_by_worker()
    alive = WorkerNode.objects.filter(stopped_at=None, seen_at__gt=now - SILENT_AFTER, engine=site_engine())
    return {
        node.name: node.cpu_model
        for node in alive
        if RECHECKS.queue in node.queues and not node.refuses and node.name not in held
    }


def _suits(job: Recheck, worker: str, nodes: Mapping[str, str], now: datetime) -> bool:
    if job.queued_at <= now - PATIENCE:
        return True
    run = job.evaluation

    def rank(name: str) -> int:
        return FARTHEST_FIRST.index(distance(run.worker, run.result.cpu_model, name, nodes.get(name, "")))

    return rank(worker) <= min(map(rank, nodes), default=len(FARTHEST_FIRST))
