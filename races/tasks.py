"""The race room's periodic work."""

from celery import shared_task

from core.database.clock import database_now

from .duels.services import drive_all_on
from .entries.services.cars import settle_due
from .entries.services.redrives import sweep_redrives
from .live.services import tick_live


@shared_task
def duels() -> int:
    """Draw the duels of races that have closed and drive on those under way. Returns how many heats were queued."""
    return drive_all_on(now=database_now())


@shared_task
def live() -> int:
    """Move live events on. Returns how many things were done."""
    return tick_live(now=database_now())


@shared_task
def redrives() -> int:
    """Rerun the runs of other engines in races that are not over. Returns the number of queued runs."""
    return sweep_redrives(now=database_now())


@shared_task
def cars() -> int:
    """Write down whose the cars of races under way are where that is not yet known. Returns of how many races."""
    return settle_due(now=database_now())
