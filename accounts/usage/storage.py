"""The ledger of racers' stored files: a quota counts the sum (``storage_mb``), pages show its parts."""

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from datetime import datetime

from django.utils.functional import Promise

from ..models import Racer

MEGABYTE = 1024 * 1024
# Bytes by racer id, of these racers or of all; those without files may be left out.
Weigh = Callable[[Collection[int] | None], Mapping[int, float]]


@dataclass(frozen=True)
class Shelf:
    """A kind of stored files. ``label`` names it; pages show shelves by ``place``."""

    place: int
    name: str
    label: str | Promise
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
