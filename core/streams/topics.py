"""Topics (``name`` or ``name:key``) that a page can follow, their access rules, and the topics that an event moves."""

import re
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from ..events.models import Event

# A racer, somebody who is not logged in, or None
Viewer = Any
Data = Mapping[str, object]
Moves = Callable[[Sequence[Event]], Mapping[int, Iterable[str]]]
T = TypeVar("T")

WRITTEN = re.compile(r"[a-z]{1,16}(:[\w-]{1,64})?", re.ASCII)
RACER = "racer"
ME = "me"  # a reader's name for their racer topic


class Backstage(Protocol):
    """What a source of messages is given by the stream process that it runs in."""

    async def ask(self, question: Callable[..., T], *arguments: Any) -> T:
        """What ``question(*arguments)`` answers, in a thread that may ask the database."""

    async def rest(self, seconds: float) -> bool:
        """Wait so long, or until the topic moves or something else happens. Whether it did."""


@dataclass(frozen=True)
class Topic:
    """A kind of topic. ``can_follow(viewer, key)`` is called for each message, in a thread that may query the database.

    For messages that are in no table: ``welcome(key)`` returns the first message of a new reader, or None;
    ``source(key, stage)`` is an asynchronous iterator, run once in each stream process while the key has readers. It
    must not block, and restarts after a failure. Other processes send messages by :func:`core.streams.push`."""

    name: str
    can_follow: Callable[[Viewer, str], bool]
    welcome: Callable[[str], Data | None] | None = None
    source: Callable[[str, Backstage], AsyncIterator[Data]] | None = None


TOPICS: dict[str, Topic] = {}
_MOVES: list[Moves] = []


def register_topic(topic: Topic) -> Topic:
    """Add a kind of topic. Registering one of the same name replaces it."""
    TOPICS[topic.name] = topic
    return topic


def register_moves(moves: Moves) -> Moves:
    """Register ``moves(events)``, which returns the moved topics by the events' primary keys."""
    if moves not in _MOVES:
        _MOVES.append(moves)
    return moves


def topics_of(events: Sequence[Event]) -> dict[int, set[str]]:
    """The topics that each of the events moves, by primary key. A few queries for all of them."""
    moved: dict[int, set[str]] = {event.pk: set() for event in events}
    for moves in _MOVES:
        for pk, topics in moves(events).items():
            moved[pk].update(topics)
    return moved


def can_follow(viewer: Viewer, topic: str) -> bool:
    """Whether the viewer may follow a topic; nobody one that is not known."""
    name, _, key = topic.partition(":")
    kind = TOPICS.get(name)
    return kind is not None and kind.can_follow(viewer, key)


def asked_for(written: Iterable[str], viewer: Viewer) -> set[str]:
    """The topics that a reader asks for; ``me`` is the reader's own. Raises ValueError for an unknown topic."""
    topics = set()
    for topic in written:
        if WRITTEN.fullmatch(topic) is None or topic.partition(":")[0] not in (ME, *TOPICS):
            raise ValueError(f"{topic[:80]!r} is not a topic")
        if topic != ME:
            topics.add(topic)
        elif is_known(viewer):
            topics.add(f"{RACER}:{viewer.pk}")
    return topics


def is_known(viewer: Viewer) -> bool:
    return viewer is not None and viewer.is_authenticated


register_topic(Topic(RACER, lambda viewer, key: is_known(viewer) and str(viewer.pk) == key))
register_moves(lambda events: {each.pk: [f"{RACER}:{each.racer_id}"] for each in events if each.racer_id is not None})
