"""The race room's periodic work."""

from __future__ import annotations

import logging

from celery import shared_task

from core.clock import database_now

from .services import drive_all_on
from .services.cars import settle_due
from .services.live import tick_live
from .services.redrives import sweep_redrives

logger = logging.getLogger(__name__)


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
    """Drive again what another engine has driven in races that are not over. Returns how many runs were queued."""
    return sweep_redrives(now=database_now())


@shared_task
def cars() -> int:
    """Write down whose the cars of races under way are where that is not yet known. Returns of how many races."""
    return settle_due(now=database_now())
