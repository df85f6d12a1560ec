"""The qualifying line of a board, drawn by a higher room: racers above it move on."""

from collections.abc import Callable
from typing import Protocol

from .selectors.board import Board


class Cut(Protocol):
    """``last_rank``: the last rank above the line, else 0. ``moved``: ids of the page's promoted racers."""

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
    """The line through a board; None for races without promotion."""
    return _registered[0](board) if _registered else None
