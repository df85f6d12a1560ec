"""Queries of the stream process: events in the order of their positions."""

from dataclasses import dataclass

from ..database.kept_queries import KeptQuery
from ..events.models import Event, EventCursor
from ..events.reading import number_new
from .topics import topics_of

AT_ONCE = 500
REPLAYED = 1000  # events sent to a reconnecting reader; one that missed more reloads the page


@dataclass(frozen=True)
class Moved:
    """An event on the stream: its position and the topics that it moves."""

    position: int
    topics: frozenset[str]


def newest() -> int:
    number_new()
    return last_numbered()


def last_numbered() -> int:
    """The same without numbering new events: later queries see every event up to it."""
    return next(iter(_position()), 0)


_position = KeptQuery(
    lambda: EventCursor.objects.filter(pk=EventCursor.NUMBERED).values_list("position", flat=True).order_by()
)


def after(position: int) -> tuple[int, list[Moved]]:
    """At most :data:`AT_ONCE` events after a position, and the last position: less than ``position`` after a restored
    backup."""
    last = newest()
    events = list(Event.objects.filter(position__gt=position).order_by("position")[:AT_ONCE])
    if events:
        last = events[-1].position or last
    return last, _moved(events)


def between(position: int, last: int) -> list[Moved] | None:
    """The events between two positions; None for more than :data:`REPLAYED`, and for positions that are gone."""
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
