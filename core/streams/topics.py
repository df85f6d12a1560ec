"""What a page can follow, who may, and which topics an event moves.

A topic is written ``name`` or ``name:key``. Asking for one tells nothing: a topic that is not there, one that may not
be seen and one that rests all answer the same, nothing.
"""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from ..events.models import Event

# A racer, somebody who is not logged in, or None
Viewer = Any
Data = dict[str, Any]
Moves = Callable[[Sequence[Event]], Mapping[int, Iterable[str]]]
T = TypeVar("T")

WRITTEN = re.compile(r"[a-z]{1,16}(:[\w-]{1,64})?", re.ASCII)
RACER = "racer"
ME = "me"  # what a reader asks for who means their own


class Backstage(Protocol):
    """What a source of messages is given by the stream process that it runs in."""

    async def ask(self, question: Callable[..., T], *arguments: Any) -> T:
        """What ``question(*arguments)`` answers, in a thread that may ask the database."""

    async def rest(self, seconds: float) -> bool:
        """Wait so long, or until the topic moves or something else happens. Whether it did."""


@dataclass(frozen=True)
class Topic:
    """A kind of topic.

    ``can_follow(viewer, key)``: whether a viewer may be told that it moves, and be sent its messages. It is asked again
    whenever something is sent, in a thread that may ask the database. Whatever a guest may follow, everybody may.

    The rest is for topics with messages of their own, which are in no table. ``welcome(key)``: what a reader is sent
    who has just come (in a thread that may ask the database; None: nothing); made once for all who come before the
    source says something new. ``source(key, stage)``: an asynchronous iterator of messages, run once in each stream
    process while somebody follows the key; it must not block, is closed when the last reader has left, and is begun
    anew when it fails. What it says after a reader came is told to them after their welcome: nothing is between.
    Messages may also come from any process by :func:`core.streams.push`.
    """

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
    """Say which topics events move: ``moves(events)`` answers with topics by the primary keys of events. Registering
    the same function twice changes nothing."""
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
    """The topics that a reader asks for; ``me`` is the reader's own. Raises ValueError for what is no topic."""
    topics = set()
    for topic in written:
        if WRITTEN.fullmatch(topic) is None:
            raise ValueError(f"{topic[:80]!r} is not a topic")
        if topic != ME:
            topics.add(topic)
        elif is_known(viewer):
            topics.add(f"{RACER}:{viewer.pk}")
    return topics


def is_known(viewer: Viewer) -> bool:
    return viewer is not None and viewer.is_authenticated


def _of_racers(events: Sequence[Event]) -> dict[int, list[str]]:
    return {event.pk: [f"{RACER}:{event.racer_id}"] for event in events if event.racer_id is not None}


register_topic(Topic(RACER, lambda viewer, key: is_known(viewer) and str(viewer.pk) == key))
register_moves(_of_racers)
