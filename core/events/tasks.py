"""Celery tasks of events: follow, sweep, trim."""

from celery import shared_task

from ..database.clock import database_now
from . import reading
from .waking import wake


@shared_task
def follow(reader: str) -> int:
    return reading.follow(reader, now=database_now())


@shared_task
def sweep() -> int:
    """Wake every reader: wake-ups get lost. Returns how many there are."""
    for name in reading.READERS:
        wake(name)
    return len(reading.READERS)


@shared_task
def trim() -> int:
    return reading.trim(now=database_now())
