"""A moment at which everybody looks: the clock, and whoever tells of what happened."""

from __future__ import annotations

from datetime import datetime

from core.events import follow
from league.seasons.services.clock import tick


def tell_what_happened(*, now: datetime) -> int:
    """Notices of all that has happened by now. Returns how many are new."""
    tick(now=now)
    return follow("notices", now=now)


def queue_deliveries(*, now: datetime) -> int:
    """Deliveries of webhooks, likewise."""
    tick(now=now)
    return follow("webhooks", now=now)
