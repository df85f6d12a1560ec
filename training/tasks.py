"""Celery's side of training: thin, because the table of jobs is the truth and a message is only a wake-up.

Trainings have a queue and workers of their own (``--queues training``), so that an evaluation never waits for one.
"""

from __future__ import annotations

import logging

from celery import Task, shared_task
from django.conf import settings

from core.clock import database_now
from core.jobs.work import work_off
from evaluation.services import note_worker
from paddock.errors import PlatformFault

from .services import TRAININGS, forget_deleted, purge_trainings, run_next_training

logger = logging.getLogger(__name__)


@shared_task(bind=True)
def train(self: Task) -> bool:
    """Run one training; send another wake-up if it was one. Without torch, below the sandbox's minimum, or where golden
    runs differ, none runs."""
    worker = self.request.hostname or "local"
    if not settings.TRAINING or settings.TRAINING_PAUSED:
        return False
    try:
        note_worker(name=worker)
    except PlatformFault as fault:
        logger.error("%s trains nothing: %s", worker, "\n".join([str(fault), *getattr(fault, "__notes__", ())]))
        return False
    return bool(work_off(TRAININGS, lambda told: run_next_training(worker=worker, interrupted=told)))


@shared_task
def sweep() -> int:
    """Requeue trainings that lost their worker, and send wake-ups for those that wait. Beat sends it every few
    seconds."""
    return TRAININGS.sweep(now=database_now()).waiting


@shared_task
def purge() -> int:
    """Delete what trainings of long ago need no more, and what is left of deleted ones."""
    forget_deleted(now=database_now())
    return purge_trainings(now=database_now())
