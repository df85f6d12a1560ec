"""The race room's periodic work."""

from __future__ import annotations

from celery import shared_task
from django.utils import timezone

from .services import drive_all_on


@shared_task
def duels() -> int:
    """Draw the duels of races that have closed and drive on those under way. Returns how many heats were queued."""
    return drive_all_on(now=timezone.now())
