"""A race and the pages of its board, which many look at: read once for all readers."""

from django.shortcuts import get_object_or_404

from accounts.models import RacerGroup, Viewer
from core.streams.shared_pieces import shared_value

from ...models import Race
from .board import PER_PAGE, Board, as_seen_by, board, group_board

_RELATED = ("track", "organiser", "group", "live_event")


def shared_race(slug: str) -> Race:
    """The race, which nobody may change and not every reader may see; :class:`~django.http.Http404` for none."""
    return shared_value(("race", slug), lambda: get_object_or_404(Race.objects.select_related(*_RELATED), slug=slug))


def shared_board(
    race: Race, racer: Viewer = None, *, page: int = 1, per_page: int = PER_PAGE, group: RacerGroup | None = None
) -> Board:
    """The :class:`Board` of a page, of ``group`` alone where one is given, with the reader's own row."""
    return as_seen_by(board_of_all(race.slug, page, per_page, group), race, racer, pinned=group is None)


def board_of_all(slug: str, page: int, per_page: int = PER_PAGE, group: RacerGroup | None = None) -> Board:
    """The same as guests see it."""

    def read() -> Board:
        race = shared_race(slug)
        if group is None:
            return board(race, page=page, per_page=per_page)
        return group_board(race, group, page=page, per_page=per_page)

    return shared_value(("board", slug, page, per_page, group and group.pk), read)
