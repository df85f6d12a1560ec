"""The workers' rows for the operators' page. A heartbeat is one UPDATE with the database's time."""

import functools
import logging
from collections.abc import Sequence
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.db.models.functions import Now
from django.utils.translation import gettext_lazy as _

from core.audit.acts import AuditAct, register
from core.audit.recording import record
from core.jobs.holds import hold_workers, holds_by_worker, resume_workers
from core.jobs.models import WorkerHold
from paddock.errors import PlatformFault, UserFault
from paddock.simulator import engine

from ..models import WorkerNode
from ..sandbox import probe as probing
from . import SCHEDULER
from . import proof as proving
from .proof import Proof
from .queue.jobs import EVALUATIONS

logger = logging.getLogger(__name__)
BEAT_EVERY_S = 15.0
SILENT_AFTER = timedelta(seconds=60)  # three beats were missed
FORGOTTEN_AFTER = timedelta(days=2)
ALL, RESUME = "all", "resume"
ORDERS = {"pause": WorkerHold.Mode.PAUSED, "drain": WorkerHold.Mode.DRAINED}
ORDERED = register(AuditAct("worker.ordered", _("Worker paused, drained or resumed")))


def note_worker(*, name: str, sandboxed: bool = True) -> WorkerNode:
    """Record this worker's sandbox, and whether it computes as every other. Raises PlatformFault
    ``sandbox_unavailable``, and ``worker_inexact`` when its golden runs differ and PADDOCK_INEXACT_WORKERS does not
    allow that. ``sandboxed=False``: it runs no submitted code."""
    sandbox = probing.probe() if sandboxed else None
    if sandbox is not None and not sandbox.sufficient:
        sandbox = probing.look_again()
    if sandbox is not None:
        _tell_of_missing_layers(sandbox)
    proof = _proof_of(name) if sandbox is not None and sandbox.sufficient else None
    allowed = settings.INEXACT_WORKERS == "allow"
    node, _ = WorkerNode.objects.update_or_create(
        name=name[:128],
        defaults={
            "seen_at": Now(),
            "stopped_at": None,
            "sandbox": sandbox.to_dict() if sandbox else {},
            "proof": {**proof.to_dict(), "allowed": allowed} if proof else {},
            "engine": engine.ENGINE_ID,
        },
    )
    if sandboxed:
        probing.require()
    if proof is not None and not proof.exact and not allowed:
        fault = PlatformFault("worker_inexact", equal=proof.equal, runs=proof.runs, engine=proof.engine)
        fault.add_note(proof.why)
        raise fault
    return node


@functools.cache
def _warn_once(level: int, missing: str) -> None:
    logger.warning("The sandbox stands at level %s only. %s", level, missing)


def _tell_of_missing_layers(sandbox: probing.SandboxReport) -> None:
    """Warn once per process, and again when it changes."""
    missing = "; ".join(f"{layer.name}: {layer.detail}" for layer in sandbox.layers if not layer.available)
    if missing:
        _warn_once(sandbox.level, missing)


def _proof_of(name: str) -> Proof | None:
    """The proof that a process of this worker has given since it came up, or this process's own."""
    given = WorkerNode.objects.filter(name=name[:128]).values_list("proof", flat=True).first()
    if given and given["exact"] and given["engine"] == engine.ENGINE_ID:
        return Proof.from_dict({key: value for key, value in given.items() if key != "allowed"})
    return proving.prove()


def start_worker(*, name: str, queues: Sequence[str], processes: int, now: datetime | Now | None = None) -> None:
    """Write down that a worker has come up, and forget those that nobody has heard of for two days."""
    now = now or Now()
    WorkerNode.objects.update_or_create(
        name=name[:128],
        defaults={
            "seen_at": now,
            "started_at": now,
            "stopped_at": None,
            "queues": sorted(queues),
            "processes": processes,
            "engine": engine.ENGINE_ID,
            "cpu_model": engine.cpu_model()[:128],
            "proof": {},  # it may be another machine by now: it proves itself anew
        },
    )
    forget_workers(now=now)


def beat_worker(*, name: str, now: datetime | Now | None = None) -> bool:
    """A worker is alive: one UPDATE. False: its row is gone, and it has to start again."""
    return bool(WorkerNode.objects.filter(name=name[:128]).update(seen_at=now or Now(), stopped_at=None))


def stop_worker(*, name: str, now: datetime | Now | None = None) -> None:
    now = now or Now()
    WorkerNode.objects.filter(name=name[:128]).update(seen_at=now, stopped_at=now)


@transaction.atomic
def order_workers(*, names: Sequence[str], order: str, now: datetime) -> list[str]:
    """Pause, drain or resume workers (:data:`ORDERS`) by name, or with :data:`ALL` every one that was heard of lately;
    the scheduler is none. Returns the names. Raises UserFault ``worker_unknown``, and then none was changed."""
    nodes = WorkerNode.objects.values_list("name", "queues")
    known = {name for name, queues in nodes if SCHEDULER not in queues}
    if order == RESUME:
        known |= holds_by_worker().keys()
    chosen = known if ALL in names else set(names)
    if unknown := chosen - known:
        raise UserFault("worker_unknown", worker=min(unknown), known=", ".join(sorted(known)) or "–")
    if order == RESUME:
        resume_workers(workers=chosen)
    else:
        hold_workers(workers=chosen, mode=ORDERS[order], now=now)
    for node in WorkerNode.objects.filter(name__in=chosen).order_by("name"):
        record(ORDERED, node, changes={"order": [None, order]})
    return sorted(chosen)


def others_listen(*, name: str, queues: Sequence[str]) -> bool:
    """Whether other living workers, which are not held, read all of these queues."""
    held = holds_by_worker()
    alive = WorkerNode.objects.filter(stopped_at=None, seen_at__gt=Now() - SILENT_AFTER).exclude(name=name[:128])
    return set(queues) <= {queue for node in alive if node.name not in held for queue in node.queues}


def engines_at_work(*, now: datetime | Now) -> set[str]:
    """The engines of all workers that run evaluations and were heard of within :data:`SILENT_AFTER` of ``now``."""
    alive = WorkerNode.objects.filter(stopped_at=None, seen_at__gt=now - SILENT_AFTER).exclude(engine="")
    return {node.engine for node in alive if EVALUATIONS.queue in node.queues and not node.refuses}


def forget_workers(*, now: datetime | Now) -> int:
    """Delete the rows of workers that were last seen long ago. How many."""
    return WorkerNode.objects.filter(seen_at__lt=now - FORGOTTEN_AFTER).delete()[0]
