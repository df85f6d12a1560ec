"""The league's rules: small classes made from a season's numbers that decide and describe themselves, without a
database."""

from collections import defaultdict
from collections.abc import Collection, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from decimal import ROUND_HALF_UP, Decimal
from itertools import islice
from typing import TypeVar

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from ..models import Season

R = TypeVar("R", bound=Hashable)


def entry_rule(division: str, stage: str | None, season: Season | None) -> str:
    """Whose a league race is and how to get in. ``stage`` and ``season``: None for a race outside a season."""
    if season is None:
        if division == "pro":
            return _("Pro division: for racers promoted from an open race.")
        if division == "open":
            return _("Open division: for racers not yet promoted.")
        return _("All divisions: open to everyone.")
    percent = {"percent": f"{Decimal(season.promotion_percent).normalize():f}"}
    if stage == "pro-finale":
        return ngettext(
            "Finale: for the best racer of this month's pro race.",
            "Finale: for the best %(size)s racers of this month's pro race.",
            season.finale_size,
        ) % {"size": season.finale_size}
    if stage == "championship":
        return ngettext(
            "Championship: for the winner of each finale.",
            "Championship: for the first %(places)s of each finale.",
            season.championship_places,
        ) % {"places": season.championship_places}
    if division == "pro":
        text = _("Pro division: finish in the best %(percent)s %% of a month's open race to be promoted and race here.")
        return text % percent
    if division == "open":
        text = _("Open division: everybody starts here. The best %(percent)s %% are promoted to the pro division.")
        return text % percent
    return _("All divisions: open to everyone.")


@dataclass(frozen=True)
class Promotion:
    """The best ``percent`` (above 0, below 100, else ValueError) of the classified racers of an open race."""

    percent: Decimal

    def __post_init__(self) -> None:
        object.__setattr__(self, "percent", Decimal(str(self.percent)))
        if not 0 < self.percent < 100:
            raise ValueError(f"percent must lie between 0 and 100, not {self.percent}")

    def places(self, classified: int) -> int:
        """How many places of a race with so many classified racers promote: rounded half up, at least one if any."""
        if classified <= 0:
            return 0
        share = (classified * self.percent / 100).quantize(Decimal(1), ROUND_HALF_UP)
        return max(1, int(share))

    def promoted(self, order: Sequence[R], classified: int, already: Collection[R] = ()) -> list[tuple[int, R]]:
        """Place and racer of each promotion. ``order``: the classified racers, the best first; racers ``already`` in a
        division leave their place to nobody."""
        held = set(already)
        best = enumerate(order[: self.places(classified)], start=1)
        return [(place, racer) for place, racer in best if racer not in held]

    def sentence(self) -> str:
        return _(
            "Everyone starts in the open division. When a month's open race closes, the best "
            "%(percent)s %% of its classified racers, rounded half up and at least one, move to the "
            "pro division for the rest of the season. Once promoted, you stay promoted. The place of "
            "an already promoted racer is not passed on."
        ) % {"percent": f"{self.percent.normalize():f}"}


@dataclass(frozen=True)
class _FirstOfRace:
    """The first ``size`` (1 or more, else ValueError) of a race without those already in the championship."""

    size: int

    def __post_init__(self) -> None:
        if self.size < 1:
            raise ValueError(f"size must be at least 1, not {self.size}")

    def chosen(self, order: Iterable[R], qualified: Collection[R]) -> list[R]:
        """The best first. ``order``: the classified racers of the race; ``qualified``: those in the championship."""
        return list(islice((racer for racer in order if racer not in qualified), self.size))


class FinaleField(_FirstOfRace):
    """Of a pro race: they drive the finale."""

    def sentence(self) -> str:
        return ngettext(
            "A month's pro race is a qualifier. Its best racer without a championship place drives the finale.",
            "A month's pro race is a qualifier. Its best %(size)s racers without a championship "
            "place meet in the finale.",
            self.size,
        ) % {"size": self.size}


class ChampionshipField(_FirstOfRace):
    """Of a finale: they qualify for the championship, each once."""

    def sentence(self) -> str:
        return ngettext(
            "The winner of a finale qualifies for the championship, which closes the season.",
            "The best %(places)s of a finale without a championship place qualify for the "
            "championship, which closes the season.",
            self.size,
        ) % {"places": self.size}


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
        listed = ", ".join(map(str, self.points))
        return ngettext(
            "The winner of a round gets %(points)s points.",
            "The first %(places)s of a round get points, in this order: %(points)s.",
            len(self.points),
        ) % {"places": len(self.points), "points": listed}


@dataclass(frozen=True)
class RoundRank:
    """A result: its rank (from 1), its round (any number that grows with time) and its points."""

    holder: Hashable
    round: int
    rank: int
    points: int


@dataclass(frozen=True)
class RacerStanding:
    """One line of standings. ``results``: by time; ``dropped``: the rounds among them whose points do not count."""

    place: int
    holder: Hashable
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
        more first ranks decide, then more second ranks and so on, in all results; then the better rank in the
        latest round in which the two differ.
        """
        by: dict[Hashable, list[RoundRank]] = defaultdict(list)
        for result in results:
            by[result.holder].append(result)
        scored = [self._scored(sorted(own, key=lambda one: one.round), rounds) for own in by.values()]
        scored.sort(key=lambda one: one[0])
        return [
            RacerStanding(place, own[0].holder, points, tuple(own), dropped)
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
        return (-points, countback, latest, str(own[0].holder)), points, own, dropped

    def sentence(self) -> str:
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
