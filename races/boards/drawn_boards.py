"""Tables of boards, drawn once for all readers."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from django.template.loader import render_to_string
from django.utils import timezone
from django.utils.safestring import SafeString
from django.utils.translation import get_language

from accounts.models import RacerGroup
from core.streams.shared_pieces import MarkedPiece, shared_value
from tracks.reference.selectors import reference_times

from ..models import Race
from .medals import race_reference_ms
from .selectors.board import Board, BoardRow
from .selectors.shared_boards import board_of_all

PAGES = 40  # with kept lines, of one process
LINES_LIVE_S = 60  # a line shows the age of a result in minutes

_kept: OrderedDict[tuple, dict[tuple, SafeString]] = OrderedDict()
_lock = threading.Lock()


class Cut(Protocol):
    """The qualifying line of a board, drawn by a higher room: racers above it move on.

    ``last_rank``: the last rank above the line, else 0. ``moved``: ids of the page's promoted racers."""

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


@dataclass(frozen=True)
class DrawnBoard:
    """A page of a board with its qualifying line as guests see it, and the lines of its table as HTML, with what
    single racers get within them."""

    board: Board
    cut: Cut | None
    lines: MarkedPiece
    head: SafeString
    facts: SafeString

    def cut_for(self, board: Board) -> Cut | None:
        """The qualifying line for the row of the reader of ``board``; the page's line knows the racers of the page."""
        mine, cut = board.my_row, self.cut
        if cut is None or mine is None or not board.my_row_is_elsewhere or (mine.rank or 0) > cut.last_rank:
            return cut
        return cut_of(replace(board, rows=[]))


def drawn_board(slug: str, page: int, group: RacerGroup | None) -> DrawnBoard:
    """A page of a race's board, of ``group`` alone where one is given: drawn once for all readers of a language and
    time zone. A group has no qualifying line."""
    key = ("drawn board", slug, page, group and group.pk, timezone.get_current_timezone_name())

    def draw() -> DrawnBoard:
        board = board_of_all(slug, page, group=group)
        cut = cut_of(board) if group is None else None
        values = {"board": board, "race": board.race}
        head = render_to_string(f"{_folder(board)}/head.html", values)
        facts = render_to_string("races/boards/facts.html", values)
        lines = MarkedPiece.read("".join(_lines(board, cut, (*key, get_language()))))
        return DrawnBoard(board, cut, lines, head, facts)

    return shared_value(key, draw)


def _lines(board: Board, cut: Cut | None, key: tuple) -> list[SafeString]:
    """The lines of a page. Those that were drawn with the same values last time, in the same minute of the result's
    age, are not drawn again: a commit changes few of them, or none."""
    with _lock:
        before = _kept.pop(key, {})
    now, race = timezone.now(), board.race
    of_race = repr([race.__dict__[field.attname] for field in Race._meta.concrete_fields])
    of_all = (of_race, repr(cut), race_reference_ms(race, reference_times()))
    kept, lines = {}, []
    for number, row in enumerate(board.rows):
        age = int((now - (row.entry.achieved_at or row.entry.entered_at)).total_seconds()) // LINES_LIVE_S
        values = (row.shown_values, age, *of_all, board.classified_count == 1, _begins(board, number))
        kept[values] = before.get(values) or _line(board, row, number, cut)
        lines.append(kept[values])
    with _lock:
        _kept[key] = kept
        while len(_kept) > PAGES:
            _kept.popitem(last=False)
    return lines


def _line(board: Board, row: BoardRow, number: int, cut: Cut | None) -> SafeString:
    values = {"race": board.race, "board": board, "row": row, "cut": cut, "begins": _begins(board, number)}
    values["is_marked"] = True
    return render_to_string(f"{_folder(board)}/line.html", values)


def _begins(board: Board, number: int) -> bool:
    """Whether another group of rows begins with this one."""
    return number > 0 and board.rows[number].group != board.rows[number - 1].group


def _folder(board: Board) -> str:
    return "races/duels" if board.is_drawn else "races/boards"
