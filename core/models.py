"""The ground floor's tables, each written down where it is used."""

from .events.models import Event, EventCursor
from .jobs.models import Outage

__all__ = ["Event", "EventCursor", "Outage"]
