"""Tables of boards, drawn once for all readers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

from django.template.loader import render_to_string
from django.utils import timezone
from django.utils.safestring import SafeString

from accounts.models import Racer, RacerGroup
from core.streams.shared_pieces import MarkedPiece, lasting_piece, shared_value
from tracks.reference.selectors import reference_times

from ..models import Race
from .medals import race_reference_ms
from .selectors.board import Board, BoardRow
from .selectors.shared_boards import board_of_all

LINES_LIVE_S = 60  # a line shows the age of a result in minutes


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
    foot: SafeString
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
        foot = render_to_string("races/boards/foot.html", {**values, "cut": cut})
        return DrawnBoard(board, cut, MarkedPiece.read("".join(_lines(board, cut))), head, foot, facts)

    return shared_value(key, draw)


def _lines(board: Board, cut: Cut | None) -> Iterator[SafeString]:
    """The lines of a page. A commit changes few of them, or none: the others are not drawn again."""
    template, of_page = f"{_folder(board)}/line.html", _values_of_page(board, cut)
    for number, row in enumerate(board.rows):
        begins = number > 0 and board.rows[number - 1].group != row.group
        yield _line(template, board, row, cut, (*of_page, begins), begins=begins, is_marked=True)


def drawn_row(board: Board, cut: Cut | None, reader: Racer) -> SafeString:
    """The row of the reader of ``board`` outside of the lines of its page; ``cut``: of :meth:`DrawnBoard.cut_for`."""
    assert board.my_row is not None
    return _line("races/boards/row.html", board, board.my_row, cut, _values_of_page(board, cut), user=reader)


def _values_of_page(board: Board, cut: Cut | None) -> tuple:
    """What all lines of a page depend on."""
    race = board.race
    of_race = repr([race.__dict__[field.attname] for field in Race._meta.concrete_fields])
    return of_race, repr(cut), race_reference_ms(race, reference_times()), board.classified_count == 1


def _line(template: str, board: Board, row: BoardRow, cut: Cut | None, of_page: tuple, **values: Any) -> SafeString:
    """A line, drawn once for the same values in the same minute of the result's age."""
    age = (timezone.now() - (row.entry.achieved_at or row.entry.entered_at)).total_seconds() // LINES_LIVE_S
    values |= {"race": board.race, "board": board, "row": row, "cut": cut}
    return lasting_piece(template, values, key=(row.shown_values, age, of_page))


def _folder(board: Board) -> str:
    return "races/duels" if board.is_drawn else "races/boards"
