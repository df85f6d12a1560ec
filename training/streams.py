"""What pages of trainings follow on the stream (:mod:`core.streams`)."""

from __future__ import annotations

from collections.abc import Sequence

from core.events import Event
from core.streams import Topic, register_moves, register_topic
from core.streams.topics import Viewer, is_known

from .events import TRAINING_ENDED
from .selectors import visible_trainings


def register() -> None:
    """``training:ID`` for its owner and admins."""
    register_topic(Topic("training", _sees_training))
    register_moves(moves)


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    return {event.pk: {f"training:{event.subject}"} for event in events if event.kind == TRAINING_ENDED.name}


def _sees_training(viewer: Viewer, key: str) -> bool:
    return is_known(viewer) and visible_trainings(viewer).filter(public_id=key).exists()
