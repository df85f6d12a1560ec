"""What pages of the queue follow on the stream (:mod:`core.streams`)."""

from __future__ import annotations

from collections.abc import Sequence

from core.events import Event
from core.streams import Topic, register_moves, register_topic

from .events import RUN_FAILED, RUN_FINISHED, RUN_QUEUED, RUN_STARTED, RUN_STOPPED

QUEUE = "queue"  # somebody's place in the queue of runs may be another now; whose run it was is not told
_MOVE_IT = {kind.name for kind in (RUN_QUEUED, RUN_STARTED, RUN_FINISHED, RUN_FAILED, RUN_STOPPED)}


def register() -> None:
    """``queue`` for everybody."""
    register_topic(Topic(QUEUE, lambda viewer, key: not key))
    register_moves(moves)


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    return {event.pk: {QUEUE} for event in events if event.kind in _MOVE_IT}
