"""Celery's side of the queue: thin, because the table of evaluations is the truth and a message is only a wake-up."""

from __future__ import annotations

import logging
from collections.abc import Callable

from celery import Task, shared_task
from celery.signals import worker_process_init, worker_process_shutdown, worker_ready

from core.clock import database_now
from core.jobs.stopping import is_stopping
from core.jobs.work import work_off
from paddock.errors import PlatformFault

from .crew import Spare
from .reports.jobs import CHUNKS, run_next_chunk, wake_if_due
from .reports.services import purge_reports
from .sandbox import probe as probing
from .services import EVALUATIONS, note_worker, purge_garages, run_next_evaluation
from .services.stored import scrub as scrub_files

logger = logging.getLogger(__name__)
_spare: Spare | None = None  # of this process of a pool
BUDGET_S = 60.0  # a task that went on for ever would keep the sweep waiting


@shared_task(bind=True)
def work(self: Task) -> int:
    """Run evaluations until none waits or the time is up. Returns how many were run.

    Below the sandbox's minimum nothing runs, nor where golden runs differ: the evaluations wait for a better worker.
    """
    worker = self.request.hostname or "local"
    if not _fit(worker):
        return 0

    def turn(told_to_stop: Callable[[], bool]) -> bool:
        fit = probing.probe().sufficient
        return fit and run_next_evaluation(worker=worker, interrupted=told_to_stop, spare=_spare)

    return work_off(EVALUATIONS, turn, budget_s=BUDGET_S, idle=_go_on_to_reports)


@shared_task(bind=True)
def sweep(self: Task) -> dict[str, int]:
    """Requeue what lost its worker and send wake-ups again. Beat sends it every few seconds."""
    fit = _fit(self.request.hostname or "local")
    report = EVALUATIONS.sweep(now=database_now())
    if fit and not report.waiting and not is_stopping():
        _wait_ready()
    return {"requeued": report.requeued, "waiting": report.waiting}


@shared_task(bind=True)
def drive_reports(self: Task) -> int:
    """Drive chunks of reports until none waits, an evaluation does, or the time is up. Returns how many were driven."""
    worker = self.request.hostname or "local"
    if not _fit(worker):
        return 0

    def turn(told_to_stop: Callable[[], bool]) -> bool:
        return probing.probe().sufficient and run_next_chunk(worker=worker, interrupted=told_to_stop)

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
    try:
        sweep.apply_async(retry=False)
    except Exception:  # the broker's client may raise anything; beat sends the next sweep
        logger.exception("The first sweep could not be sent.")


@worker_process_init.connect
def begin_process(**kwargs: object) -> None:
    """A process of a pool keeps the processes of the next evaluation ready."""
    global _spare
    _spare = Spare()


@worker_process_shutdown.connect
def end_process(**kwargs: object) -> None:
    """What was kept ready is not needed any more. (It dies with this process in any case.)"""
    if _spare is not None:
        _spare.close()


def _go_on_to_reports() -> None:
    """Reports have waited for the evaluations."""
    _wait_ready()
    wake_if_due(database_now())


def _wait_ready() -> None:
    """Start the processes of the evaluation to come while there is nothing to do. In a pool's process only."""
    if _spare is not None:
        _spare.prepare()


def _fit(worker: str) -> bool:
    """Note the worker; whether untrusted code may run in it, and comes to what it must."""
    try:
        note_worker(name=worker)
    except PlatformFault as fault:
        logger.error("%s runs nothing: %s", worker, "\n".join([str(fault), *getattr(fault, "__notes__", ())]))
        return False
    return True
