"""The ledger of racers' stored files: a quota counts the sum, pages show its parts."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import QuerySet, Value
from django.utils.functional import Promise

from core.database.kept_queries import KeptQuery

from ..models import Racer
from ..quotas import CountedRows, Racers, one_of

MEGABYTE = 1024 * 1024
STORAGE_QUOTA = "storage_mb"
# Bytes by racer id, of these racers or of all; those without files may be left out, and others be there several times.
Weigh = Callable[[Racers], list[CountedRows]]


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


def _weighed(racers: Racers) -> Iterator[tuple[int, str, float]]:
    """Racer id, shelf and MB of what is stored, in any order. One query."""
    one = one_of(racers)
    for racer, size, name in _rows(racers) if one is None else _rows_of_one(racer=one):
        yield racer, name, size / MEGABYTE


def _rows(racers: Racers) -> QuerySet[Any, Any]:
    parts = [part.annotate(_shelf=Value(name)) for name, shelf in _shelves.items() for part in shelf.weigh(racers)]
    return parts[0].union(*parts[1:], all=True)


_rows_of_one: KeptQuery[Any] = KeptQuery(lambda racer: _rows(racer))


def megabytes(racers: Racers, now: datetime) -> Mapping[int, float]:
    """MB on all shelves by racer id: the count of the quota."""
    total: dict[int, float] = defaultdict(float)
    for racer, _name, mb in _weighed(racers):
        total[racer] += mb
    return total


def stored_by(racer: Racer) -> list[Stored]:
    """What one racer has on each shelf that holds anything of theirs."""
    mb: dict[str, float] = defaultdict(float)
    for _racer, name, size in _weighed([racer.pk]):
        mb[name] += size
    shelves = sorted(_shelves.values(), key=lambda shelf: shelf.place)
    return [Stored(shelf, mb[shelf.name]) for shelf in shelves if mb[shelf.name]]
