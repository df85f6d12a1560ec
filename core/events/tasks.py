"""The periodic work of events, and what a wake-up asks for."""

from __future__ import annotations

from celery import shared_task
from django.utils import timezone

from . import reading
from .waking import wake


@shared_task
def follow(reader: str) -> int:
    """Let a reader do what happened since it last looked. Returns how many things it told."""
    return reading.follow(reader, now=timezone.now())


@shared_task
def sweep() -> int:
    """Wake every reader: wake-ups get lost. Returns how many there are."""
    for name in reading.READERS:
        wake(name)
    return len(reading.READERS)


@shared_task
def trim() -> int:
    """Delete events that are old and that every reader has passed. Returns how many."""
    return reading.trim(now=timezone.now())
