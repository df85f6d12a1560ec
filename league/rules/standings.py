"""The standings of a season: points by place, worst results dropped, ties broken by a fixed chain."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field

from django.utils.translation import gettext as _
from django.utils.translation import ngettext


@dataclass(frozen=True)
class PointsTable:
    """Points by place, the winner's first. Raises ValueError for an empty table and for one that rises."""

    points: tuple[int, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", tuple(self.points))
        if not self.points or min(self.points) < 0:
            raise ValueError("a table has points of 0 or more for at least one place")
        if any(after > before for before, after in zip(self.points, self.points[1:], strict=False)):
            raise ValueError(f"a table of points never rises: {self.points}")

    def __len__(self) -> int:
        return len(self.points)

    def of(self, rank: int) -> int:
        """The points of a rank from 1; none beyond the table."""
        return self.points[rank - 1] if 1 <= rank <= len(self.points) else 0

    def sentence(self) -> str:
        """The rule in the reader's language."""
        listed = ", ".join(map(str, self.points))
        return ngettext(
            "The winner of a round gets %(points)s points.",
            "The first %(places)s of a round get points, in this order: %(points)s.",
            len(self.points),
        ) % {"places": len(self.points), "points": listed}


@dataclass(frozen=True)
class RoundRank:
    """Who was at which rank (from 1) in which round (any numbers that grow with time), and the points for it."""

    who: Hashable
    round: int
    rank: int
    points: int


@dataclass(frozen=True)
class RacerStanding:
    """One line of standings. ``results``: by time; ``dropped``: the rounds among them whose points do not count."""

    place: int
    who: Hashable
    points: int
    results: tuple[RoundRank, ...]
    dropped: frozenset[int] = field(default_factory=frozenset)


@dataclass(frozen=True)
class Standings:
    """How results become standings. ``drop_worst``: how many of the rounds held are dropped for each, 0 or more."""

    drop_worst: int = 0

    def counting(self, rounds: int) -> int:
        """How many results count after so many rounds: at least one once a round was held."""
        return min(rounds, max(1, rounds - self.drop_worst))

    def lines(self, results: Iterable[RoundRank], rounds: int) -> list[RacerStanding]:
        """The standings after ``rounds`` rounds, the first first; the order of ``results`` does not matter.

        A round without a result counts as no points, so it is dropped before any result with points is. Equal points:
        who has more first ranks, then more second ranks and so on, in all results; then who was ranked better in the
        latest round in which the two differ.
        """
        by: dict[Hashable, list[RoundRank]] = defaultdict(list)
        for result in results:
            by[result.who].append(result)
        scored = [self._scored(sorted(own, key=lambda one: one.round), rounds) for own in by.values()]
        scored.sort(key=lambda one: one[0])
        return [
            RacerStanding(place, own[0].who, points, tuple(own), dropped)
            for place, (_key, points, own, dropped) in enumerate(scored, start=1)
        ]

    def _scored(self, own: Sequence[RoundRank], rounds: int) -> tuple[tuple, int, Sequence[RoundRank], frozenset[int]]:
        best_first = sorted(own, key=lambda one: (-one.points, one.rank, one.round))
        counted = best_first[: self.counting(rounds)]
        points = sum(one.points for one in counted)
        dropped = frozenset(one.round for one in best_first[len(counted) :])
        ranks = sorted(one.rank for one in own)
        # countback: more first ranks first. An end of the list loses against any further rank.
        countback = (*ranks, float("inf"))
        latest = tuple((-one.round, one.rank) for one in reversed(own))
        return (-points, countback, latest, str(own[0].who)), points, own, dropped

    def sentence(self) -> str:
        """The rule in the reader's language."""
        dropped = (
            _("All rounds count.")
            if not self.drop_worst
            else ngettext(
                "The worst result is dropped, a missed round first.",
                "The worst %(count)s results are dropped, missed rounds first.",
                self.drop_worst,
            )
            % {"count": self.drop_worst}
        )
        ties = _(
            "Ties: more first places win, then more second places, and so on; then the better place "
            "in the latest round with different places."
        )
        return f"{dropped} {ties}"
