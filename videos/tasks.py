"""The tasks of videos, in their own queue (``--queues videos``), so that no evaluation waits for a video."""

from celery import Task, shared_task
from django.conf import settings

from core.database.clock import database_now
from core.jobs.work import work_off
from evaluation.running.worker_nodes import note_worker

from .services import VIDEOS, purge_videos, run_next_video


@shared_task(bind=True)
def draw(self: Task) -> bool:
    """Draw one video, and send another wake-up; nothing where videos are switched off."""
    if not settings.VIDEOS:
        return False
    worker = self.request.hostname or "local"
    note_worker(name=worker, sandboxed=False)
    return bool(work_off(VIDEOS, lambda interrupted: run_next_video(worker=worker, interrupted=interrupted)))


@shared_task
def sweep() -> int:
    """Requeue videos that lost their worker, and send wake-ups for waiting ones. Beat sends it every few seconds."""
    return VIDEOS.sweep(now=database_now()).waiting


@shared_task
def purge() -> int:
    """Delete videos that are no longer watched. Beat sends it every few hours."""
    return purge_videos(now=database_now())
