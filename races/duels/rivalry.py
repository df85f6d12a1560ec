"""Two racers against each other: races that both took part in, and heats in which both drove."""

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.db.models import OuterRef, Q, QuerySet, Subquery

from accounts.models import Racer, Viewer

from ..boards.selectors.board import CLASSIFIED, ORDER
from ..entries.selectors.visibility import races_visible_to
from ..models import DuelCompetitor, Entry

RIVALS = 3
RIVALS_LOOK = timedelta(days=30)
RIVALS_BOARDS = 20
_NEAR = (2, 1)  # points for the racers one and two places away


@dataclass(frozen=True)
class HeadToHead:
    """How often each of two stood before the other: in races of simulated cars (both classified), and in heats (both
    placed)."""

    races_ahead: int
    races_behind: int
    heats_ahead: int
    heats_behind: int

    @property
    def met(self) -> bool:
        """Whether they have met at all."""
        return bool(self.races_ahead + self.races_behind + self.heats_ahead + self.heats_behind)


@dataclass(frozen=True)
class Rivalry:
    """A racer near another one on boards. ``boards``: the number of boards; ``record``: their head-to-head record."""

    rival: Racer
    boards: int
    record: HeadToHead


def head_to_head(one: Racer, other: Racer, viewer: Viewer) -> HeadToHead:
    """``one`` against ``other``, in the races that ``viewer`` may see: two queries, which grow with their own races."""
    return heads_to_heads(one, [other.pk], viewer)[other.pk]


def heads_to_heads(one: Racer, others: Collection[int], viewer: Viewer) -> dict[int, HeadToHead]:
    """:func:`head_to_head` against each of several (ids), in two queries together."""
    seen = races_visible_to(viewer).filter(physical=False).order_by().values("pk")
    racers = [one.pk, *others]
    mine = Entry.objects.filter(racer=one).values("race")
    classified = Entry.objects.filter(CLASSIFIED, race__in=seen, withdrawn_at=None, is_baseline=False)
    standings = list(classified.filter(racer__in=racers, race__in=mine).values_list("race", "racer", *ORDER))
    heats = DuelCompetitor.objects.filter(duel__race__in=seen, place__isnull=False, entry__racer__in=racers)
    placed = list(heats.filter(duel__race__in=mine).values_list("duel", "entry__racer", "place"))
    return {other: HeadToHead(*_ahead(standings, one.pk, other), *_ahead(placed, one.pk, other)) for other in others}


def rivals_of(racer: Racer, viewer: Viewer, now: datetime) -> list[Rivalry]:
    """The racers nearest to a racer, at most ``RIVALS``; four queries for boards of any length.

    The rule: of the boards on which the racer's standing was achieved in the last 30 days and which ``viewer`` may see,
    the latest 20 count. The racers just before and just behind get two points there, the next one either way one point.
    Most points is nearest; equals are ordered by number of such boards, then by alias. House cars and closed accounts
    are nobody's rivals. Boards of duels count by their qualifying; boards of real cars do not
    count.
    """
    seen = races_visible_to(viewer).filter(physical=False).order_by().values("pk")
    mine = Entry.objects.filter(CLASSIFIED, racer=racer, race__in=seen, withdrawn_at=None, is_baseline=False)
    mine = mine.filter(achieved_at__gt=now - RIVALS_LOOK).order_by("-achieved_at", "-pk")
    near = {
        f"{way}_{step}": Subquery(found.values("racer")[step : step + 1])
        for way, found in (("before", _beside(before=True)), ("behind", _beside(before=False)))
        for step in range(len(_NEAR))
    }
    points: Counter[int] = Counter()
    boards: Counter[int] = Counter()
    for row in mine.annotate(**near).values(*near)[:RIVALS_BOARDS]:
        for name, rival in row.items():
            if rival is not None:
                points[rival] += _NEAR[int(name[-1])]
                boards[rival] += 1
    racers = Racer.objects.filter(is_active=True, is_house=False).in_bulk(list(points))
    nearest = sorted(racers.values(), key=lambda one: (-points[one.pk], -boards[one.pk], one.alias))[:RIVALS]
    if not nearest:
        return []
    records = heads_to_heads(racer, [one.pk for one in nearest], viewer)
    return [Rivalry(one, boards[one.pk], records[one.pk]) for one in nearest]


def _beside(*, before: bool) -> QuerySet[Entry]:
    """The entries before or behind an outer query's entry on its board, the nearest first."""
    way, end = ("lt", "lte") if before else ("gt", "gte")
    beyond = Q()
    same: dict[str, OuterRef] = {}
    for column in ORDER:
        beyond |= Q(**same, **{f"{column}__{way}": OuterRef(column)})
        same[column] = OuterRef(column)
    others = Entry.objects.filter(CLASSIFIED, race=OuterRef("race"), withdrawn_at=None, is_baseline=False)
    # the first condition is a range of the index
    found = others.filter(**{f"rank_score__{end}": OuterRef("rank_score")}).filter(beyond)
    return found.order_by(*(f"-{column}" if before else column for column in ORDER))


def _ahead(rows: Iterable[tuple], one: int, other: int) -> tuple[int, int]:
    """How often each of two racers stood before the other; rows: meeting, racer and order."""
    met: dict[int, dict[int, tuple]] = {}
    for where, racer, *order in rows:
        met.setdefault(where, {})[racer] = tuple(order)
    both = [(each[one], each[other]) for each in met.values() if one in each and other in each]
    return sum(mine < theirs for mine, theirs in both), sum(mine > theirs for mine, theirs in both)
