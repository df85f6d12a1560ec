"""The kinds of pages whose links have a card, and the content of a card. Rooms register theirs at the start."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from django.urls import reverse
from django.utils.functional import Promise

if TYPE_CHECKING:
    from django.db.models import QuerySet

SURFACE = "#151a21"  # the ground of a picture
Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class CardShape:
    """A polygon or line of a card's picture, y up, in any unit: all shapes of a picture are fitted into its place.

    ``fill`` and ``line``: colours ``#rrggbb``; ``width``: of the line, in pixels of the card."""

    points: Points
    fill: str = ""
    line: str = ""
    width: float = 0.0
    closed: bool = True


@dataclass(frozen=True)
class CardFigure:
    """A large value with its label."""

    label: str
    value: str
    colour: str = ""


@dataclass(frozen=True)
class CardRow:
    """A line of a board."""

    place: str
    name: str
    value: str = ""


@dataclass(frozen=True)
class ShareCard:
    """All that a card shows, in one language. ``picture``: a map; ``car``: a small picture beside the title.

    Equal cards are equal pictures, so this is also what a drawn card is kept by."""

    kind: str
    title: str
    lines: tuple[str, ...] = ()
    figures: tuple[CardFigure, ...] = ()
    rows: tuple[CardRow, ...] = ()
    note: str = ""
    picture: tuple[CardShape, ...] = ()
    car: tuple[CardShape, ...] = ()

    @property
    def description(self) -> str:
        """The card in a sentence, for those who cannot see it."""
        board = (f"{row.place}. {row.name} {row.value}".strip() for row in self.rows[:3])
        parts = (*self.lines, *(f"{one.label} {one.value}" for one in self.figures), *board, self.note)
        return " · ".join(part for part in parts if part)


@dataclass(frozen=True)
class EmbeddedPart:
    """What an embedded page shows: its template with the context, which has nothing of a reader."""

    template: str
    context: dict[str, object]
    height: int  # of the frame, in px


@dataclass(frozen=True)
class CardKind:
    """A kind of page whose links have a card.

    ``page``: the name of its address, which takes the page's key. ``card``: the card of a key as guests may see it,
    without results if the second argument is true; None where guests may see nothing. ``public``: the pages that guests
    may see, ordered, for the site map; ``changed``: their attribute with the time of the last change.
    ``results``: the name of an address whose results (:mod:`races.spoilers.hidden_addresses`) the card shows.
    ``embedded``: what other sites may frame, under the conditions of ``card``;
    ``also``: names of other addresses of it, which take the same key.
    """

    name: str
    label: str | Promise
    page: str
    argument: str
    card: Callable[[str, bool], ShareCard | None]
    public: Callable[[], QuerySet[Any]]
    changed: str = ""
    results: str = ""
    embedded: Callable[[str, bool], EmbeddedPart | None] | None = None
    also: tuple[str, ...] = ()

    def address(self, key: str) -> str:
        return reverse(self.page, args=[key])


_modules: list[str] = []


def register_cards(modules: Iterable[str]) -> None:
    """Register modules by name, which the first request for a card loads: each has its kinds in ``KINDS``."""
    _modules.extend(module for module in modules if module not in _modules)


@cache
def card_kinds() -> Mapping[str, CardKind]:
    """All kinds by name."""
    return {kind.name: kind for module in _modules for kind in import_module(module).KINDS}
