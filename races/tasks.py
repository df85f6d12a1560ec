"""The race room's periodic work."""

from celery import Task, shared_task

from core.database.clock import database_now
from core.jobs.work import work_off
from evaluation.sandbox import probe
from evaluation.tasks import is_fit

from .boards.day_ranks import note_ranks
from .duels.services import drive_all_on
from .entries.services.redrives import sweep_redrives
from .live.services import tick_live
from .rechecks.jobs import RECHECKS, run_next_recheck
from .rechecks.services import draw_sample
from .runs.service_days import measure_days


@shared_task
def duels() -> int:
    """Draw the duels of races that have closed and drive on those under way. Returns how many heats were queued."""
    return drive_all_on(now=database_now())


@shared_task
def live() -> int:
    """Move live events on. Returns how many things were done."""
    return tick_live(now=database_now())


@shared_task
def service_days() -> int:
    """Measure how fast submissions got their results. Returns the number of measured days."""
    return measure_days(now=database_now())


@shared_task
def day_ranks() -> int:
    """Write down the ranks of the day in each open race. Returns the number of races."""
    return note_ranks(now=database_now())


@shared_task
def redrives() -> int:
    """Rerun the runs of other engines in races that are not over. Returns the number of queued runs."""
    return sweep_redrives(now=database_now())


@shared_task(bind=True)
def recheck(self: Task) -> int:
    """Drive official results again until none is left for this worker or other runs wait. Returns how many."""
    worker = self.request.hostname or "local"
    if not is_fit(worker):
        return 0
    return work_off(
        RECHECKS,
        lambda must_stop: probe.probe().sufficient and run_next_recheck(worker=worker, interrupted=must_stop),
    )


@shared_task
def rechecks() -> dict[str, int]:
    """Draw the sample of the day when its hour has come, and send wake-ups again. Beat sends it every minute."""
    now = database_now()
    drawn, report = draw_sample(now=now), RECHECKS.sweep(now=now)
    return {"drawn": drawn, "requeued": report.requeued, "waiting": report.waiting}
