"""Celery's side of reference laps."""

from celery import Task, shared_task

from core.database.clock import database_now
from core.jobs.work import work_off

from .reference.jobs import REFERENCES, run_next_reference


@shared_task(bind=True)
def drive_references(self: Task) -> int:
    """Drive reference laps until none is left or another job waits. Returns how many were begun."""
    worker = self.request.hostname or "local"
    return work_off(
        REFERENCES,
        lambda must_stop: run_next_reference(worker=worker, interrupted=must_stop),
        budget_s=60.0,
    )


@shared_task
def references() -> dict[str, int]:
    """Queue reference laps that are missing, and send wake-ups again. Beat sends it every ten minutes."""
    report = REFERENCES.sweep(now=database_now())
    return {"requeued": report.requeued, "waiting": report.waiting}
