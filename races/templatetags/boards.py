"""Rows of a board that are drawn once for all of its readers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from django import template
from django.template import Context
from django.template.base import FilterExpression, NodeList, Parser, Token
from django.utils import timezone
from django.utils.safestring import SafeString, mark_safe
from django.utils.translation import get_language

from accounts.models import RacerGroup
from races.cuts import Cut, cut_of
from races.models import Race
from races.selectors import Board, races_visible_to
from races.selectors.live import live_now
from races.selectors.on_track import on_track
from races.streams import RACES

register = template.Library()


@register.inclusion_tag("races/parts/track_now.html", takes_context=True)
def track_now(context: Context, races: Iterable[Race] | None = None, follows: str = RACES) -> dict[str, Any]:
    """Who is on track now and who is next: in the page's own race, in ``races``, or in all that the reader may see.
    ``follows``: what moves it; of a race, that race."""
    user = getattr(context.get("request"), "user", None)
    race: Race | None = context.get("race") if races is None else None
    wanted: list[int] | None
    if race is not None:
        wanted, follows = [race.pk], f"race:{race.pk}"
    else:
        wanted = None if races is None else [each.pk for each in races]
    live = [] if race is not None and not hasattr(race, "live_event") else live_now(user, timezone.now(), wanted)
    told = {"track": on_track(user, wanted), "live": live}
    return told | {"follows": follows, "race": race, "user": user}


@register.simple_tag
def cut_of_board(board: Board) -> Cut | None:
    """The line through a board; None for races that move nobody on."""
    return cut_of(board)


@register.simple_tag(takes_context=True)
def races_of_group(context: Context, group: RacerGroup) -> list[Race]:
    """Races that are held for the group alone and that the reader may see, the latest first."""
    viewer = getattr(context.get("request"), "user", None)
    return list(races_visible_to(viewer).filter(group=group).order_by("-opens_at", "-pk")[:50])


class _Drawn(template.Node):
    def __init__(self, board: FilterExpression, row: FilterExpression, beside: list, inside: NodeList) -> None:
        self.board, self.row, self.beside, self.nodelist = board, row, beside, inside

    def render(self, context: Context) -> SafeString:
        board, row = self.board.resolve(context), self.row.resolve(context)
        if row.is_me:
            return self.nodelist.render(context)
        key = (get_language() or "", row.told, *(repr(each.resolve(context)) for each in self.beside))
        if key not in board.drawn:
            board.drawn[key] = str(self.nodelist.render(context))
        return mark_safe(board.drawn[key])


@register.tag
def drawn(parser: Parser, token: Token) -> _Drawn:
    """``{% drawn board row cut %}...{% enddrawn %}``: a row as another reader of the same page was shown it.

    The reader's own row is always drawn anew. What stands inside may look at nothing else than the row, the language
    and the values that are named after the row.
    """
    words = token.split_contents()
    if len(words) < 3:
        raise template.TemplateSyntaxError(f"{words[0]} takes a board, a row and what else the row shows")
    inside = parser.parse(("enddrawn",))
    parser.delete_first_token()
    board, row, *beside = map(parser.compile_filter, words[1:])
    return _Drawn(board, row, beside, inside)
