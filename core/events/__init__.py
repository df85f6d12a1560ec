"""Events of this site, recorded in the transaction where something happens, and followed by readers exactly once."""

from .kinds import KINDS, EventKind, register
from .models import Event
from .reading import EventReader, follow, register_reader
from .recording import record, record_all, written
