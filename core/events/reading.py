"""Following the events: each reader gets every event of its kinds exactly once.

Ids are drawn before the commit, so a lower id may become visible after a higher one. Readers therefore follow
positions, which :func:`number_new` gives to committed events under the lock of one row. A reader's writes and its
cursor are one transaction under the cursor's lock. A reader that raises gets the same event again."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.db.models import Count, Min, Q, QuerySet

from .kinds import EventKind
from .models import Event, EventCursor
from .waking import interested

AT_ONCE = 500


@dataclass(frozen=True)
class EventReader:
    """A reader of events of some kinds.

    ``handle(event, now)`` writes the consequences within the transaction of the cursor, and returns their number. It
    queues mails and requests to other sites."""

    name: str
    kinds: tuple[EventKind, ...]
    handle: Callable[[Event, datetime], int]


READERS: dict[str, EventReader] = {}


def register_reader(reader: EventReader) -> EventReader:
    """Let a reader have its events from the oldest that is kept. Registering one twice changes nothing."""
    READERS[reader.name] = reader
    interested(reader.name, {kind.name for kind in reader.kinds})
    return reader


def follow(name: str, *, now: datetime) -> int:
    """Handle a reader's new events in order. Returns the sum of the handlers' results."""
    reader = READERS[name]
    number_new()
    handled = 0
    while _is_behind(reader):
        with transaction.atomic():
            cursor = _locked(name)
            event = _ahead(reader, cursor.position).first()
            if event is not None:  # None: somebody else took it
                handled += reader.handle(event, now)
                EventCursor.objects.filter(pk=name).update(position=event.position)
    return handled


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
    """Delete events older than ``PADDOCK_EVENTS_KEPT_DAYS`` that every reader has passed. Returns how many."""
    number_new()
    passed = min((_pass_unwanted(reader) for reader in READERS.values()), default=None)
    old = Event.objects.filter(recorded_at__lt=now - timedelta(days=settings.EVENTS_KEPT_DAYS))
    old = old.filter(position__isnull=False) if passed is None else old.filter(position__lte=passed)
    deleted = 0
    while some := list(old.order_by("recorded_at").values_list("pk", flat=True)[:AT_ONCE]):
        deleted += Event.objects.filter(pk__in=some).delete()[0]
    return deleted


@dataclass(frozen=True)
class Lag:
    """How far a reader is behind: the events that it has not read, and when the first of them was recorded."""

    events: int
    since: datetime | None


def lags() -> dict[str, Lag]:
    """How far each reader is behind, by its name: one query for each and two more."""
    cursors = dict(EventCursor.objects.values_list("reader", "position"))
    new = Q(position=None)
    found = {}
    for reader in READERS.values():
        wanted = Q(kind__in=[kind.name for kind in reader.kinds])
        unread = Event.objects.filter(wanted, Q(position__gt=cursors.get(reader.name, 0)) | new)
        counted = unread.order_by().aggregate(events=Count("pk"), since=Min("recorded_at"))
        found[reader.name] = Lag(counted["events"], counted["since"])
    return found


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
