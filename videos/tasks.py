"""Celery's side of videos: thin, because the table of videos is the truth.

Videos have a queue and a worker of their own (``--queues videos``), so that an evaluation never waits for one.
"""

from __future__ import annotations

from celery import Task, shared_task
from django.conf import settings

from core.clock import database_now
from core.jobs.work import work_off
from evaluation.services import note_worker

from .services import VIDEOS, purge_videos, run_next_video


@shared_task(bind=True)
def draw(self: Task) -> bool:
    """Draw one video; send another wake-up if there was one. Where videos are switched off none is drawn."""
    if not settings.VIDEOS:
        return False
    worker = self.request.hostname or "local"
    note_worker(name=worker, sandboxed=False)
    return bool(work_off(VIDEOS, lambda told: run_next_video(worker=worker, interrupted=told)))


@shared_task
def sweep() -> int:
    """Requeue videos that lost their worker, and send wake-ups for those that wait. Beat sends it every few seconds."""
    return VIDEOS.sweep(now=database_now()).waiting


@shared_task
def purge() -> int:
    """Delete videos that nobody watches any more. Beat sends it every few hours."""
    return purge_videos(now=database_now())
