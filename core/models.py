"""The ground floor's models, in the module that Django searches."""

from .api.models import StoredAnswer
from .audit.models import AuditEntry
from .events.models import Event, EventCursor
from .jobs.models import Outage, WorkerHold
from .personal_data.models import DiscardedFile

__all__ = ["AuditEntry", "DiscardedFile", "Event", "EventCursor", "Outage", "StoredAnswer", "WorkerHold"]
