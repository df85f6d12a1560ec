"""Celery tasks of training, with their own queue and workers, so that evaluations never wait for trainings."""

import logging
from collections.abc import Callable

from celery import Task, shared_task
from django.conf import settings

from core.database.clock import database_now
from core.jobs.work import work_off
from evaluation.running.worker_nodes import note_worker
from paddock.errors import PlatformFault

from .jobs.services.deletion import forget_deleted
from .jobs.services.queue import TRAININGS
from .jobs.services.records import purge_trainings
from .jobs.services.worker import run_next_training
from .sweeps.services import advance_sweeps, sweeps_due

logger = logging.getLogger(__name__)


@shared_task(bind=True)
def train(self: Task) -> bool:
    """Run one training; wake the next. Without torch, a sufficient sandbox and equal golden runs, none runs."""
    worker = self.request.hostname or "local"
    if not settings.TRAINING or settings.TRAINING_PAUSED:
        return False
    try:
        note_worker(name=worker)
    except PlatformFault as fault:
        logger.error("%s trains nothing: %s", worker, "\n".join([str(fault), *getattr(fault, "__notes__", ())]))
        return False

    def turn(interrupted: Callable[[], bool]) -> bool:
        advance_sweeps(now=database_now())
        return run_next_training(worker=worker, interrupted=interrupted)

    return bool(work_off(TRAININGS, turn))


@shared_task
def sweep() -> int:
    """Requeue trainings that lost their worker, and send wake-ups for those in the queue and for sweeps that wait for a
    trainer; a periodic task."""
    if sweeps_due().exists():
        TRAININGS.wake()
    return TRAININGS.sweep(now=database_now()).waiting


@shared_task
def purge() -> int:
    """Delete what trainings of long ago need no more, and what is left of deleted ones."""
    forget_deleted(now=database_now())
    return purge_trainings(now=database_now())
