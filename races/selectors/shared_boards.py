"""Pages of boards that many look at: made once for all, and each reader's own row beside it."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING

from core.unchanged import Unchanged, is_shared

from ..models import Race
from .boards import PER_PAGE, Board, as_seen_by, board

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

# What is drawn says how long ago a result came, so it lives no longer than that is right
LIVES_S = 1.0
PAGES = 40  # of one process, of at most a few hundred kilobytes each

_pages: Unchanged[Board] = Unchanged(PAGES)
_drawn: OrderedDict[tuple, tuple[float, dict]] = OrderedDict()
_lock = threading.Lock()


def shared_board(
    race: Race, racer: Racer | AnonymousUser | None = None, *, page: int = 1, per_page: int = PER_PAGE
) -> Board:
    """What :func:`races.selectors.board` gives, its page read once for all readers while the database is as it was."""
    if not is_shared():
        return board(race, racer, page=page, per_page=per_page)
    key = (race.pk, page, per_page)

    def make() -> tuple[Board, bool]:
        return replace(board(race, page=page, per_page=per_page), drawn=_drawn_lately(key)), True

    return as_seen_by(_pages.get(key, LIVES_S, make), race, racer)


def _drawn_lately(key: tuple) -> dict[tuple, str]:
    """The rows of a page that were drawn within the time that they live. A commit changes few of them, or none."""
    with _lock:
        began_at, drawn = _drawn.pop(key, (0.0, {}))
        if time.monotonic() - began_at > LIVES_S:
            began_at, drawn = time.monotonic(), {}
        _drawn[key] = (began_at, drawn)
        while len(_drawn) > PAGES:
            _drawn.popitem(last=False)
    return drawn
