"""Wakes readers after an event is committed; a lost wake-up delays them by a minute."""

from collections.abc import Collection
from dataclasses import dataclass
from time import monotonic

from django.db import connection, transaction

from ..wakeups.workers import send

FOLLOW = "core.events.tasks.follow"
LEFT_ALONE_S = 5.0
_INTERESTED: dict[str, set[str]] = {}
_away_until = 0.0


def interested(reader: str, kinds: set[str]) -> None:
    """Remember which kinds of events wake a reader."""
    _INTERESTED[reader] = kinds


def wake_readers(kinds: Collection[str]) -> None:
    """Wake whoever reads events of these kinds, once, when the present transaction is committed."""
    waiting = {entry[1] for entry in connection.run_on_commit if isinstance(entry[1], _WakeUp)}
    for reader, wanted in _INTERESTED.items():
        call = _WakeUp(reader)
        if wanted.intersection(kinds) and call not in waiting:
            transaction.on_commit(call, robust=True)


@dataclass(frozen=True)
class _WakeUp:
    reader: str

    def __call__(self) -> None:
        wake(self.reader)


def wake(reader: str) -> None:
    """Wake a worker for a reader. After a failure the broker is left alone for a moment."""
    global _away_until
    if monotonic() >= _away_until and not send(FOLLOW, 1, args=[reader]):
        _away_until = monotonic() + LEFT_ALONE_S
