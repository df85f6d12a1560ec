"""What race pages show of the season that a race belongs to."""

from __future__ import annotations

from typing import Any

from django import template
from django.db.models import Exists, OuterRef
from django.utils import timezone
from django.utils.safestring import SafeString, mark_safe

from league.models import Racer, Round, Season
from league.selectors import decisions_of
from league.selectors.boards import BoardCut, board_cut, round_of
from races.models import Entry, Race
from races.selectors import Board

register = template.Library()
DECISIONS = 20


@register.simple_tag
def round_shown(race: Race) -> Round | None:
    """The round that a race is; none for community races."""
    return round_of(race)


@register.simple_tag
def cut_of_board(board: Board) -> BoardCut | None:
    """The line that the season draws through a board: promoted, in the finale, qualified. None before its opening."""
    round_ = round_of(board.race)
    if round_ is None:
        return None
    racers = [row.entry.racer_id for row in board.rows if row.rank is not None]
    if board.my_row is not None and board.my_row.rank is not None:
        racers.append(board.my_row.entry.racer_id)
    return board_cut(round_, board.classified_count, racers)


@register.inclusion_tag("league/parts/decisions.html")
def decisions_shown(race: Race) -> dict[str, Any]:
    """Since when results are official, until when they can be corrected, and what stewards decided and why."""
    round_ = round_of(race)
    if round_ is None or (round_.closed_at is None and round_.held_at is None):
        return {}
    decisions = list(decisions_of(round_)[:DECISIONS])
    return {"round": round_, "decisions": decisions, "under_review": round_.is_under_review(timezone.now())}


@register.simple_tag
def seasons_of(racer: Racer) -> list[Season]:
    """The seasons that a racer has raced in, the latest first."""
    entries = Entry.objects.filter(race__round__season=OuterRef("pk"), racer=racer, withdrawn_at=None)
    return list(Season.objects.filter(Exists(entries)).order_by("-starts_on", "-pk"))


@register.filter
def drawn(svg: str) -> SafeString:
    """A drawing of league.drawing, whose texts are escaped where it is made."""
    return mark_safe(svg)
