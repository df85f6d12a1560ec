"""What happened on this site, written once and read by whoever tells of it.

A room registers its kinds (:mod:`.kinds`) and calls :func:`record` in the transaction in which something happens: the
event stands or falls with it. Readers (:mod:`.reading`) get every event of the kinds they want exactly once, each at
its own pace; :mod:`.visibility` says who may see an event.
"""

from .kinds import KINDS, EventKind, register
from .models import Event
from .reading import EventReader, follow, register_reader
from .recording import record, record_all, written
from .visibility import OWN, can_see_event, events_visible_to, register_audience

__all__ = [
    "KINDS",
    "OWN",
    "Event",
    "EventKind",
    "EventReader",
    "can_see_event",
    "events_visible_to",
    "follow",
    "record",
    "record_all",
    "register",
    "register_audience",
    "register_reader",
    "written",
]
