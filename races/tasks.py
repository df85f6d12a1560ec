"""The race room's periodic work, and Celery's side of videos: thin, because the table of videos is the truth.

Videos have a queue and a worker of their own (``--queues videos``), so that an evaluation never waits for one.
"""

from __future__ import annotations

import logging

from celery import shared_task
from django.conf import settings

from core.clock import database_now
from core.jobs.work import work_off
from evaluation.services import note_worker

from .services import drive_all_on
from .services.cars import settle_due
from .services.redrives import sweep_redrives
from .services.videos import VIDEOS, purge_videos, run_next_video

logger = logging.getLogger(__name__)


@shared_task
def duels() -> int:
    """Draw the duels of races that have closed and drive on those under way. Returns how many heats were queued."""
    return drive_all_on(now=database_now())


@shared_task
def redrives() -> int:
    """Drive again what another engine has driven in races that are not over. Returns how many runs were queued."""
    return sweep_redrives(now=database_now())


@shared_task
def cars() -> int:
    """Write down whose the cars of races under way are where that is not yet known. Returns of how many races."""
    return settle_due(now=database_now())


@shared_task(bind=True)
def draw(self) -> bool:
    """Draw one video; ring again if there was one. Where videos are switched off none is drawn."""
    if not settings.VIDEOS:
        return False
    worker = self.request.hostname or "local"
    note_worker(name=worker, sandboxed=False)
    return bool(work_off(VIDEOS, lambda told: run_next_video(worker=worker, interrupted=told)))


@shared_task
def sweep() -> int:
    """Requeue videos that lost their worker, and ring for those that wait. Beat sends it every few seconds."""
    return VIDEOS.sweep(now=database_now()).waiting


@shared_task
def purge() -> int:
    """Delete videos that nobody watches any more. Beat sends it every few hours."""
    return purge_videos(now=database_now())
