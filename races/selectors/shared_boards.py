"""Pages of boards that many look at: made once for all, and each reader's own row beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evaluation.services.unchanged import Unchanged, is_shared

from ..models import Race
from .boards import PER_PAGE, Board, as_seen_by, board, page_for_all

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from league.models import Racer

# What is drawn says how long ago a result came, so it lives no longer than that is right
LIVES_S = 1.0
PAGES = 40  # of one process, of at most a few hundred kilobytes each

_pages: Unchanged[Board] = Unchanged(PAGES)


def shared_board(
    race: Race, racer: Racer | AnonymousUser | None = None, *, page: int = 1, per_page: int = PER_PAGE
) -> Board:
    """What :func:`races.selectors.board` gives, its page read once for all readers while the database is as it was."""
    if not is_shared():
        return board(race, racer, page=page, per_page=per_page)
    shown = _pages.get((race.pk, page, per_page), LIVES_S, lambda: (page_for_all(race, page, per_page), True))
    return as_seen_by(shown, race, racer)
