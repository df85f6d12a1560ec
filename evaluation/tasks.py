"""Celery's side of the queue: thin, because the table of evaluations is the truth and a message is only a wake-up."""

import logging
from collections.abc import Callable

from celery import Task, shared_task
from celery.signals import worker_init, worker_ready

from core.database.clock import database_now
from core.jobs.stopping import is_stopping
from core.jobs.work import work_off
from core.wakeups.workers import send
from paddock.errors import PlatformFault

from .garage.services import purge_garages
from .reports.jobs import CHUNKS, run_next_chunk, wake_if_due
from .reports.services import purge_reports
from .running.process_pool import SparePool
from .running.queue.jobs import EVALUATIONS
from .running.queue.worker import run_next_evaluation
from .running.worker_nodes import note_worker
from .sandbox import probe as probing
from .stored_files import scrub as scrub_files

logger = logging.getLogger(__name__)
_spare: SparePool | None = None  # of this process, where it is a worker
_refusal = ""  # why this process runs nothing: logged once, not at every message
BUDGET_S = 60.0  # a task that went on for ever would keep the sweep waiting


@shared_task(bind=True)
def work(self: Task) -> int:
    """Run evaluations until none waits or the time is up. Returns how many were run. Nothing runs below the sandbox's
    minimum, nor where golden runs differ."""
    worker = self.request.hostname or "local"
    if not is_fit(worker):
        return 0

    def turn(must_stop: Callable[[], bool]) -> bool:
        fit = probing.probe().sufficient
        return fit and run_next_evaluation(worker=worker, interrupted=must_stop, spare=_spare)

    return work_off(EVALUATIONS, turn, budget_s=BUDGET_S, idle=_go_on_to_reports)


@shared_task(bind=True)
def sweep(self: Task) -> dict[str, int]:
    """Requeue what lost its worker and send wake-ups again. Beat sends it every few seconds."""
    is_fit(self.request.hostname or "local")
    report = EVALUATIONS.sweep(now=database_now())
    return {"requeued": report.requeued, "waiting": report.waiting}


@shared_task(bind=True)
def get_ready(self: Task) -> None:
    """A car is being uploaded: its evaluation is about to come. Nothing hangs on it."""
    if is_fit(self.request.hostname or "local"):
        _wait_ready()


@shared_task(bind=True)
def drive_reports(self: Task) -> int:
    """Drive chunks of reports until none waits, an evaluation does, or the time is up. Returns how many were driven."""
    worker = self.request.hostname or "local"
    if not is_fit(worker):
        return 0

    def turn(must_stop: Callable[[], bool]) -> bool:
        return probing.probe().sufficient and run_next_chunk(worker=worker, interrupted=must_stop)

    return work_off(CHUNKS, turn, budget_s=BUDGET_S, idle=_wait_ready)


@shared_task
def sweep_reports() -> dict[str, int]:
    """Put chunks back that lost their worker, and send wake-ups again. Beat sends it every few seconds."""
    report = CHUNKS.sweep(now=database_now())
    return {"requeued": report.requeued, "waiting": report.waiting}


@shared_task
def purge() -> int:
    """Remove deleted models that never raced. Beat sends it every few hours."""
    purge_reports(now=database_now())
    return purge_garages(now=database_now())


@shared_task
def scrub() -> dict[str, int]:
    """Check some of the stored files. Beat sends it again and again in the small hours."""
    return scrub_files(now=database_now())


@worker_ready.connect
def sweep_at_start(sender: object = None, **kwargs: object) -> None:
    """A worker that comes up does not wait for beat: what the last one left behind is put right at once."""
    send(sweep.name, 1)


@worker_init.connect
def begin_worker(**kwargs: object) -> None:
    """A worker (each process of its pool, where that has some) may keep the processes of the next evaluation ready."""
    global _spare
    _spare = SparePool()


def _go_on_to_reports() -> None:
    _wait_ready()
    wake_if_due(database_now())


def _wait_ready() -> None:
    """Start the processes of the evaluation to come while there is nothing to do. In a worker only."""
    if _spare is not None and not is_stopping():
        _spare.prepare()


def is_fit(worker: str) -> bool:
    """Note the worker; whether untrusted code may run in it, and comes to what it must."""
    global _refusal
    try:
        note_worker(name=worker)
    except PlatformFault as fault:
        refusal = "\n".join([str(fault), *getattr(fault, "__notes__", ())])
        if refusal != _refusal:
            logger.error("%s runs nothing: %s", worker, refusal)
        _refusal = refusal
        return False
    _refusal = ""
    return True
