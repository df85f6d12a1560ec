"""Lists workers, queues and failed jobs for operators, and queues failed jobs again."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

from django.db import IntegrityError, transaction
from django.db.models import Count, QuerySet
from django.utils.translation import gettext_lazy as _

from core.audit.acts import AuditAct, register
from core.audit.recording import record
from core.jobs.holds import holds_by_worker
from core.jobs.models import WorkerHold
from core.jobs.queues import Queue, all_queues
from evaluation.models import WorkerNode
from evaluation.running.worker_nodes import SILENT_AFTER
from paddock.errors import UserFault
from paddock.errors.reasons import REASONS

FAILED_WITHIN = timedelta(hours=1)
RUN_AGAIN = register(AuditAct("job.run_again", _("Failed job run again")))


@dataclass(frozen=True)
class Failures:
    """How many failed for a reason. ``ours``: whether the platform is at fault."""

    code: str
    count: int
    ours: bool


@dataclass(frozen=True)
class QueueNow:
    """A queue at a moment. ``oldest``: since when its first job waits; ``failed``: of the last hour, the most frequent
    reason first; ``listening``: live workers that serve it; ``held``: those that an operator has paused or drained."""

    queue: Queue
    waiting: int
    running: int
    oldest: datetime | None
    failed: list[Failures]
    listening: int
    held: int


@dataclass(frozen=True)
class WorkerNow:
    """A worker at a moment. ``state``: "alive", "refuses" (takes no work), "paused", "draining" (ends when it is free),
    "drained" (has), "stopped" (in good order) or "silent"; ``jobs``: by queue; ``hold``: what holds it."""

    node: WorkerNode
    state: str
    jobs: list[tuple[Queue, Any]] = field(default_factory=list)
    hold: WorkerHold | None = None

    @property
    def machine(self) -> str:
        return self.node.name.rpartition("@")[2]


def workers_at(now: datetime) -> list[WorkerNow]:
    """All workers that were heard of lately, the live ones first: six queries, however many there are."""
    holds = holds_by_worker()
    shown = [
        WorkerNow(node, state_at(node, holds.get(node.name), now), hold=holds.get(node.name))
        for node in WorkerNode.objects.order_by("name")
    ]
    by_name = {one.node.name: one for one in shown}
    for queue in all_queues():
        running = queue.jobs().filter(state=queue.kind.working)
        for job in running.select_related(*queue.related).order_by("pk"):
            if job.worker in by_name:
                by_name[job.worker].jobs.append((queue, job))
    order = ("alive", "refuses", "paused", "draining", "silent", "drained", "stopped")
    return sorted(shown, key=lambda one: (order.index(one.state), one.node.name))


def queues_at(now: datetime, workers: Sequence[WorkerNow]) -> list[QueueNow]:
    """The queues: how long they are, since when the first one waits, and what failed in the last hour."""
    return [_queue_at(queue, now, workers) for queue in all_queues()]


def failed_runs(queue: Queue, *, reason: str = "", worker: str = "", after: datetime | None = None) -> QuerySet:
    """What failed in a queue, of one reason, by one worker, after a moment, the newest first."""
    rows = queue.failed_runs()
    wanted = {"reason_code": reason, "worker": worker}
    rows = rows.filter(**{name: value for name, value in wanted.items() if value})
    return rows if after is None else rows.filter(ended_at__gte=after)


def state_at(node: WorkerNode, hold: WorkerHold | None, now: datetime) -> str:
    """``WorkerNow.state`` of a worker and what holds it."""
    drained = hold is not None and hold.mode == WorkerHold.Mode.DRAINED
    if node.stopped_at is not None:
        return "drained" if drained else "stopped"
    if node.seen_at < now - SILENT_AFTER:
        return "silent"
    if hold is not None:
        return "draining" if drained else "paused"
    return "refuses" if node.refuses else "alive"


def _queue_at(queue: Queue, now: datetime, workers: Sequence[WorkerNow]) -> QueueNow:
    kind, rows = queue.kind, queue.jobs().order_by()
    counts = dict(rows.filter(state__in=(kind.waiting, kind.working)).values_list("state").annotate(Count("pk")))
    first = rows.filter(state=kind.waiting).order_by(kind.since).values_list(kind.since, flat=True).first()
    failed = rows.filter(state=kind.failed, ended_at__gte=now - FAILED_WITHIN)
    reasons = failed.values_list("reason_code").annotate(many=Count("pk")).order_by("-many", "reason_code")
    return QueueNow(
        queue,
        counts.get(kind.waiting, 0),
        counts.get(kind.working, 0),
        first,
        [Failures(code, many, code in REASONS and REASONS[code].fault == "platform") for code, many in reasons],
        sum(one.state == "alive" and kind.queue in one.node.queues for one in workers),
        sum(one.hold is not None and kind.queue in one.node.queues for one in workers),
    )


@dataclass
class RetryReport:
    queued: int = 0
    refused: Counter[str] = field(default_factory=Counter)


def retry_jobs(*, queue: Queue, jobs: Iterable[Any], now: datetime) -> RetryReport:
    """Queue each of these failed jobs again, each in its own transaction. A job that was queued meanwhile counts as
    neither."""
    report = RetryReport()
    for job in jobs:
        try:
            with transaction.atomic():
                if queue.run_again(job, now):
                    report.queued += 1
                    record(RUN_AGAIN, job)
        except UserFault as fault:
            report.refused[str(fault)] += 1
        except IntegrityError:  # another one of that name runs by now
            report.refused[""] += 1
    return report
