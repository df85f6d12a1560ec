"""The line through a board that a room above draws: who stands above it moves on."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from .selectors import Board


class Cut(Protocol):
    """``last_rank``: the last rank above the line, 0 while nobody is classified. ``moved``: ids of the racers of the
    page whom the race moves on. ``sentence``: the rule. What a page says of it stands in the slots ``board.moved``,
    ``board.cut`` and ``board.me``."""

    @property
    def last_rank(self) -> int: ...
    @property
    def moved(self) -> frozenset[int]: ...
    @property
    def sentence(self) -> str: ...


_registered: list[Callable[[Board], Cut | None]] = []


def register_cut(of_board: Callable[[Board], Cut | None]) -> None:
    """Called once, when the site starts."""
    _registered[:] = [of_board]


def cut_of(board: Board) -> Cut | None:
    """The line through a board; None for races that move nobody on."""
    return _registered[0](board) if _registered else None
