"""The table of events as the stream process reads it: in order, by position, nothing missed."""

from __future__ import annotations

from dataclasses import dataclass

from ..events.models import Event, EventCursor
from ..events.reading import number_new
from .topics import topics_of

AT_ONCE = 500
REPLAYED = 1000  # events that a reader is told of who comes back; one who missed more reads the page anew


@dataclass(frozen=True)
class Moved:
    """An event on the stream: its position and the topics that it moves."""

    position: int
    topics: frozenset[str]


def newest() -> int:
    """The last position that was given."""
    number_new()
    return last_numbered()


def last_numbered() -> int:
    """The same without numbering what is new: whoever reads the table from now on sees all up to it."""
    return EventCursor.objects.filter(pk=EventCursor.NUMBERED).values_list("position", flat=True).first() or 0


def after(position: int) -> tuple[int, list[Moved]]:
    """What happened after a position, at most :data:`AT_ONCE` events, and up to where that is: less than ``position``
    where the table is not the one any more in which that was given (a backup was restored)."""
    last = newest()
    events = list(Event.objects.filter(position__gt=position).order_by("position")[:AT_ONCE])
    if events:
        last = events[-1].position or last
    return last, _moved(events)


def between(position: int, last: int) -> list[Moved] | None:
    """What happened after one position up to another; None where that is more than :data:`REPLAYED`, not kept any more,
    or in a table that is not the one in which these positions were given."""
    if position == last:
        return []
    if not 0 <= position < last or last - position > REPLAYED:
        return None
    events = list(Event.objects.filter(position__gt=position, position__lte=last).order_by("position"))
    # trimming takes the oldest first, so a gap is at the beginning
    return _moved(events) if events and events[0].position == position + 1 else None


def _moved(events: list[Event]) -> list[Moved]:
    topics = topics_of(events)
    return [Moved(event.position or 0, frozenset(topics[event.pk])) for event in events]
