"""What racers leave in the storage of files: one ledger, in which each room says what it keeps for whom.

A quota counts the sum (``storage_mb``), pages show its parts.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from django.utils.functional import _StrPromise

    from accounts.models import Racer

MEGABYTE = 1024 * 1024
# Bytes by racer id, of these racers or of all; who has stored nothing may be left out.
Weigh = Callable[[Collection[int] | None], Mapping[int, float]]


@dataclass(frozen=True)
class Shelf:
    """One kind of stored files. ``label`` says what they are; pages show shelves by ``place``."""

    place: int
    name: str
    label: str | _StrPromise
    weigh: Weigh


@dataclass(frozen=True)
class Stored:
    """How much a racer has on a shelf, in MB of 2**20 bytes."""

    shelf: Shelf
    mb: float


_shelves: dict[str, Shelf] = {}


def register(shelf: Shelf) -> None:
    """Make a shelf known. Called when the site starts."""
    _shelves[shelf.name] = shelf


def megabytes(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """MB on all shelves by racer id: the count of the quota."""
    total: dict[int, float] = defaultdict(float)
    for shelf in _shelves.values():
        for racer, size in shelf.weigh(racers).items():
            total[racer] += size / MEGABYTE
    return total


def stored_by(racer: Racer) -> list[Stored]:
    """What one racer has on each shelf that holds anything of theirs."""
    weighed = (
        Stored(shelf, shelf.weigh([racer.pk]).get(racer.pk, 0) / MEGABYTE)
        for shelf in sorted(_shelves.values(), key=lambda shelf: shelf.place)
    )
    return [stored for stored in weighed if stored.mb]
