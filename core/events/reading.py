"""Following the events: each reader gets every event of its kinds exactly once.

**Nothing is missed.** A row's id is drawn when it is written, but on PostgreSQL a transaction with a lower id may be
committed after one with a higher id: whoever remembered the highest id seen would never come back for the late one. So
readers do not go by ids. Committed events are given their ``position`` afterwards, by :func:`number_new`, which every
reader calls first. It numbers what it sees on from the last position, in one transaction, under the lock of one row. So
positions become visible in their order, and whoever has read up to one has seen every event that will ever stand at or
below it. A transaction that is committed late is numbered late, and nobody waits for it. On SQLite there is one writer
at a time, and the same holds. Positions are plain data: they stay right when a database is dumped and restored.

**Nothing is done twice.** A reader's cursor is a row. Taking an event, all that the reader writes for it and the new
cursor are one transaction under that row's lock: killed anywhere, all of it has happened or nothing has. Several
processes may follow for the same reader: they take turns.

A reader that raises stays where it is and is called again with the same event; the other readers go on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.db.models import QuerySet

from .kinds import EventKind
from .models import Event, EventCursor
from .waking import interested

AT_ONCE = 500
READERS: dict[str, EventReader] = {}


@dataclass(frozen=True)
class EventReader:
    """Who reads events of some kinds.

    ``handle(event, now)`` writes what follows from an event, within the transaction that moves the cursor, and returns
    how many things it told. It must do nothing that cannot be rolled back: what goes out of the house is queued in it.
    """

    name: str
    kinds: tuple[EventKind, ...]
    handle: Callable[[Event, datetime], int]


def register_reader(reader: EventReader) -> EventReader:
    """Let a reader have its events from the oldest that is kept. Registering one twice changes nothing."""
    READERS[reader.name] = reader
    interested(reader.name, {kind.name for kind in reader.kinds})
    return reader


def follow(name: str, *, now: datetime) -> int:
    """Let a reader do what happened since it last looked, in order. Returns how many things it told."""
    reader = READERS[name]
    number_new()
    told = 0
    while _is_behind(reader):
        with transaction.atomic():
            cursor = _locked(name)
            event = _ahead(reader, cursor.position).first()
            if event is not None:  # None: somebody else took it
                told += reader.handle(event, now)
                EventCursor.objects.filter(pk=name).update(position=event.position)
    return told


def number_new() -> int:
    """Give a position to every committed event that has none. Returns how many got one."""
    given = 0
    while (new := Event.objects.filter(position=None)).exists():
        with transaction.atomic():
            last = _locked(EventCursor.NUMBERED).position
            events = list(new.order_by("pk").only("pk")[:AT_ONCE])
            for place, event in enumerate(events, start=1):
                event.position = last + place
            Event.objects.bulk_update(events, ["position"])
            EventCursor.objects.filter(pk=EventCursor.NUMBERED).update(position=last + len(events))
        given += len(events)
    return given


def trim(*, now: datetime) -> int:
    """Delete events that were recorded more than ``PADDOCK_EVENTS_KEPT_DAYS`` ago and that every reader has passed.
    Returns how many."""
    number_new()
    passed = min((_pass_unwanted(reader) for reader in READERS.values()), default=None)
    old = Event.objects.filter(recorded_at__lt=now - timedelta(days=settings.EVENTS_KEPT_DAYS))
    old = old.filter(position__isnull=False) if passed is None else old.filter(position__lte=passed)
    deleted = 0
    while some := list(old.order_by("recorded_at").values_list("pk", flat=True)[:AT_ONCE]):
        deleted += Event.objects.filter(pk__in=some).delete()[0]
    return deleted


def _pass_unwanted(reader: EventReader) -> int:
    """Move a reader past events that are not its own; returns where it stands."""
    with transaction.atomic():
        cursor = _locked(reader.name)
        # read before the events: up to here all of them can be seen
        last = EventCursor.objects.filter(pk=EventCursor.NUMBERED).values_list("position", flat=True).first() or 0
        ahead = _ahead(reader, cursor.position).filter(position__lte=last).first()
        passed = last if ahead is None or ahead.position is None else ahead.position - 1
        if passed > cursor.position:
            EventCursor.objects.filter(pk=reader.name).update(position=passed)
    return max(passed, cursor.position)


def _is_behind(reader: EventReader) -> bool:
    """Whether a look without a lock finds something: most looks end here."""
    position = EventCursor.objects.filter(pk=reader.name).values_list("position", flat=True).first()
    return _ahead(reader, position or 0).exists()


def _ahead(reader: EventReader, position: int) -> QuerySet[Event]:
    wanted = Event.objects.filter(position__gt=position, kind__in=[kind.name for kind in reader.kinds])
    return wanted.order_by("position")


def _locked(name: str) -> EventCursor:
    EventCursor.objects.get_or_create(pk=name)
    return EventCursor.objects.select_for_update().get(pk=name)
