"""The board of a race as one group of racers sees itself: its members alone, with their places among each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from accounts.groups.selectors import groups_visible_to, inside
from accounts.models import RacerGroup

from ..models import Race
from .boards import CLASSIFIED, PER_PAGE, Board, board_entries, has_rank, make_row

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


def groups_on(race: Race, racer: Racer | AnonymousUser | None, most: int = 12) -> list[RacerGroup]:
    """Groups that the reader knows of and that have somebody on the board: one query."""
    seen = groups_visible_to(racer).filter(
        members__confirmed_at__isnull=False,
        members__racer__entries__race=race,
        members__racer__entries__withdrawn_at=None,
    )
    return list(seen.distinct().order_by("-is_listed", "name", "pk")[:most])


def group_board(
    race: Race,
    group: RacerGroup,
    racer: Racer | AnonymousUser | None = None,
    *,
    page: int = 1,
    per_page: int = PER_PAGE,
) -> Board:
    """Page ``page`` of the board of ``race`` with the confirmed members of ``group`` alone. Gaps are to the first of
    them. Four queries, whatever its length; the cost grows with the group."""
    entries = board_entries(race).filter(racer__in=inside(group).values("racer"), is_baseline=False)
    count, classified = entries.count(), entries.filter(CLASSIFIED).count()
    pages = max(1, -(-count // per_page))
    page = min(max(1, page), pages)
    offset = (page - 1) * per_page
    shown = list(entries.select_related("racer", "best__evaluation", "car_of__racer")[offset : offset + per_page])
    first = entries.filter(CLASSIFIED).first() if offset else next(iter(shown), None)
    leader = first.score_ms if first is not None and has_rank(first) and first.seed is None else None
    reader = racer.pk if racer is not None and racer.is_authenticated else None
    rows = [
        make_row(entry, at if has_rank(entry) else None, race, leader, reader)
        for at, entry in enumerate(shown, start=offset + 1)
    ]
    mine = next((row for row in rows if row.is_me), None)
    entry = mine.entry if mine else None if reader is None else race.entries.filter(racer=reader).first()
    return Board(
        race=race,
        rows=rows,
        count=count,
        classified_count=classified,
        page=page,
        pages=pages,
        my_row=mine,
        my_entry=entry,
        leader_ms=leader,
    )
