"""Two racers against each other: races that both took part in, and heats in which both drove."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..models import DuelCompetitor, Entry
from .boards import CLASSIFIED, ORDER
from .visibility import races_visible_to

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


@dataclass(frozen=True)
class HeadToHead:
    """How often each of two stood before the other: in races (both classified), and in heats (both placed)."""

    races_ahead: int
    races_behind: int
    heats_ahead: int
    heats_behind: int

    @property
    def met(self) -> bool:
        """Whether they have met at all."""
        return bool(self.races_ahead + self.races_behind + self.heats_ahead + self.heats_behind)


def head_to_head(one: Racer, other: Racer, viewer: Racer | AnonymousUser | None) -> HeadToHead:
    """``one`` against ``other``, in the races that ``viewer`` may see: two queries, which grow with their own races."""
    seen = races_visible_to(viewer).order_by().values("pk")
    pair = (one.pk, other.pk)
    classified = Entry.objects.filter(CLASSIFIED, race__in=seen, withdrawn_at=None, is_baseline=False)
    standings = classified.filter(racer__in=pair).values_list("race", "racer", *ORDER)
    heats = DuelCompetitor.objects.filter(duel__race__in=seen, place__isnull=False, entry__racer__in=pair)
    placed = heats.values_list("duel", "entry__racer", "place")
    return HeadToHead(*_ahead(standings, *pair), *_ahead(placed, *pair))


def _ahead(rows: Iterable[tuple], one: int, other: int) -> tuple[int, int]:
    """How often the first and the second stood before the other, of rows of what they met in, racer and order."""
    met: dict[int, dict[int, tuple]] = {}
    for where, racer, *order in rows:
        met.setdefault(where, {})[racer] = tuple(order)
    both = [(each[one], each[other]) for each in met.values() if len(each) == 2]
    return sum(mine < theirs for mine, theirs in both), sum(mine > theirs for mine, theirs in both)
