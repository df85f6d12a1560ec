"""How laps become a standing: one class for each ranking method, which also says its rule in plain sentences.

Pure functions of the laps that an evaluation measured (paddock.simulator LapResult dicts, times in whole simulated
milliseconds); no database. The average is the old service's (DRoA, ModelPerformanceMetricsHelper.ts): the lowest
floor(mean) over every window of so many consecutive complete laps as are needed. Unlike there, an unfinished lap is
never a best lap.

A race of duels (``Points``) ranks by its method until they are drawn: that is the qualifying. Then it ranks by what the
duels gave (races.duels.points).

Order on a board, the same for every method: classified cars by score, then best lap, then fewer resets, then the
earlier submission; below them the others, who drove farther first; last who has no result yet.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from django.conf import settings
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext

if TYPE_CHECKING:
    from .models import Race

Lap = Mapping[str, Any]

# What stands in the rank columns of an entry that has no score. Any score is below all of them.
MOST_DRIVEN = 1_000_000  # more than any race's laps in percent
NOT_CLASSIFIED = 10**12
NO_RESULT = 2 * 10**12
LAST = 2**31 - 1

# So much less the rank column of a score that was driven in a race's live event has: it stands before all others.
LIVE_LEAD = 10**12

# The rank columns of an entry that was drawn for duels: see drawn_rank.
SEEDS = 128  # more than any field has cars
NO_LAP_MS = 2_000_000  # more than any lap lasts


@dataclass(frozen=True)
class Standing:
    """What one submission is worth in a race. Times in milliseconds, None where nothing was driven for it.

    ``window``: numbers of the first and last lap that the average is taken over. ``total_ms``: of all laps, if all are
    complete. ``driven_percent``: completion of all laps added up (300 = three laps). ``sectors``: of the best lap;
    ``best_sectors``: the best time in each over all complete laps; both empty when no lap is complete. ``is_live``:
    driven in the race's live event, so that it counts before all that was not.
    """

    classified: bool
    score_ms: int | None
    average_ms: int | None
    best_lap_ms: int | None
    total_ms: int | None
    complete_laps: int
    driven_percent: int
    off_tracks: int
    crashes: int
    resets: int
    sectors: tuple[int, ...]
    best_sectors: tuple[int, ...]
    best_lap_number: int | None
    window: tuple[int, int] | None
    is_live: bool = False

    @property
    def rank_score(self) -> int:
        """First thing a board sorts by, smaller first."""
        if self.classified and self.score_ms is not None:
            return self.score_ms - LIVE_LEAD * self.is_live
        return NOT_CLASSIFIED - min(self.driven_percent, MOST_DRIVEN)

    @property
    def rank_lap(self) -> int:
        """Second thing a board sorts by."""
        return LAST if self.best_lap_ms is None else self.best_lap_ms

    @property
    def key(self) -> tuple[int, int, int]:
        """What two submissions are compared by, smaller is better; equal ones by who came earlier."""
        return self.rank_score, self.rank_lap, self.resets


@dataclass(frozen=True)
class Column:
    """A column of times on a board. ``figure``: what of a :class:`Standing` (and of an entry) stands in it; ``ranks``:
    whether it is what the board is sorted by; ``shown``: the class of a column that only wider pages show."""

    figure: str
    label: Any
    ranks: bool
    shown: str = ""


class RankingRule(ABC):
    """One ranking method: its score, its rule in plain sentences, and how pages name and show it.

    ``column``: heading of the score's column on a board; ``figure``: the figure of a :class:`Standing` that is the
    score. A method whose score is none of the others says how :meth:`score` comes about.
    """

    code: str
    column: Any
    figure = "score_ms"

    def standing(self, laps: Sequence[Lap], needed: int) -> Standing:
        """The standing that ``laps`` (in the order driven) are worth.

        A car is classified when it finished ``needed`` consecutive laps. Raises ValueError if that is below 1.
        """
        if needed < 1:
            raise ValueError(f"laps needed must be at least 1, not {needed}")
        complete = [lap for lap in laps if lap["complete"]]
        best = min(complete, key=lambda lap: lap["time_ms"], default=None)
        window = _best_window(laps, needed)
        average_ms = None if window is None else _total(laps[window : window + needed]) // needed
        total_ms = _total(laps) if laps and len(complete) == len(laps) and len(laps) >= needed else None
        best_ms = None if best is None else best["time_ms"]
        standing = Standing(
            classified=False,
            score_ms=None,
            average_ms=average_ms,
            best_lap_ms=best_ms,
            total_ms=total_ms,
            complete_laps=len(complete),
            driven_percent=sum(100 if lap["complete"] else int(lap["completion_percentage"]) for lap in laps),
            off_tracks=sum(lap["off_tracks"] for lap in laps),
            crashes=sum(lap["crashes"] for lap in laps),
            resets=sum(lap["resets"] for lap in laps),
            sectors=() if best is None else _sectors(best),
            best_sectors=best_of_sectors(_sectors(lap) for lap in complete),
            best_lap_number=None if best is None else best["number"],
            window=None if window is None else (laps[window]["number"], laps[window + needed - 1]["number"]),
        )
        score_ms = None if window is None else self.score(standing, laps)
        return standing if score_ms is None else replace(standing, classified=True, score_ms=score_ms)

    def score(self, standing: Standing, laps: Sequence[Lap]) -> int | None:
        """The score of a car that finished enough consecutive laps, in milliseconds; None if it still has none."""
        score: int | None = getattr(standing, self.figure)
        return score

    def name(self, race: Race) -> str:
        """What ``race`` ranks by, in a few words of the reader's language."""
        return str(self.column)

    def columns(self, race: Race) -> tuple[Column, ...]:
        """The columns of times on a board: average and best lap, and before them the score where it is neither. Of
        one lap that is enough all are the same time, shown once."""
        by_average, by_lap = self.figure == "average_ms", self.figure == "best_lap_ms"
        if laps_needed(race) == 1:
            by_best = by_average or by_lap
            return (
                Column("best_lap_ms", gettext_lazy("Best lap"), True)
                if by_best
                else Column(self.figure, self.column, True),
            )
        return (
            *(() if by_average or by_lap else (Column(self.figure, self.column, True),)),
            Column("average_ms", gettext_lazy("Average"), by_average, "c-wide" if by_lap else ""),
            Column("best_lap_ms", gettext_lazy("Best lap"), by_lap, "" if by_lap else "c-mid"),
        )

    @abstractmethod
    def rule(self, race: Race) -> str:
        """What ``race`` ranks by and who is classified, in plain sentences of the reader's language."""


class Average(RankingRule):
    """Lowest mean of any window of N consecutive complete laps, in whole milliseconds rounded down."""

    code = "average"
    column = gettext_lazy("Average")
    figure = "average_ms"

    def name(self, race: Race) -> str:
        laps = laps_needed(race)
        return _("Average of %(laps)s laps") % {"laps": laps} if laps > 1 else _("Best lap")

    def rule(self, race: Race) -> str:
        laps = laps_needed(race)
        # not the words of the best lap's rule: gettext knows a sentence and its plural by the singular alone
        return ngettext(
            "Ranked by the lowest time of one complete lap. Cars without a complete lap are not classified.",
            "Ranked by the lowest average of %(laps)s consecutive complete laps, rounded down to the "
            "millisecond. Cars without %(laps)s consecutive laps are not classified.",
            laps,
        ) % {"laps": laps}


class Best(RankingRule):
    """The fastest complete lap; unfinished laps never count."""

    code = "best"
    column = gettext_lazy("Best lap")
    figure = "best_lap_ms"

    def rule(self, race: Race) -> str:
        laps = laps_needed(race)
        return ngettext(
            "Ranked by the fastest complete lap. Cars without a complete lap are not classified.",
            "Ranked by the fastest complete lap. Cars without %(laps)s consecutive laps are not classified.",
            laps,
        ) % {"laps": laps}


class Total(RankingRule):
    """The time of all laps together; all of them must be complete."""

    code = "total"
    column = gettext_lazy("Total")
    figure = "total_ms"

    def name(self, race: Race) -> str:
        return _("Total of %(laps)s laps") % {"laps": race.laps} if race.laps > 1 else _("Total")

    def rule(self, race: Race) -> str:
        return ngettext(
            "Ranked by the time of the one lap. Cars without a complete lap are not classified.",
            "Ranked by the total time of all %(laps)s laps. Cars that do not finish all laps are not classified.",
            race.laps,
        ) % {"laps": race.laps}


class Points(RankingRule):
    """Duels: points, then the average lap of all duels. Until they are drawn, ``qualifying`` is the rule."""

    column = gettext_lazy("Points")

    def __init__(self, qualifying: RankingRule) -> None:
        self.qualifying = qualifying
        self.code = qualifying.code

    def score(self, standing: Standing, laps: Sequence[Lap]) -> int | None:
        return self.qualifying.score(standing, laps)

    def name(self, race: Race) -> str:
        return self.qualifying.name(race)

    def columns(self, race: Race) -> tuple[Column, ...]:
        return self.qualifying.columns(race)

    def rule(self, race: Race) -> str:
        qualifying = _("Qualifying: %(rule)s") % {"rule": self.qualifying.rule(race)}
        if race.duel_format == "bracket":
            duels = _bracket_rule(race) % {"limit": settings.DUELS_IN_BRACKET}
        else:
            duels = _(
                "After closing, the best %(limit)s classified cars meet in a round robin, %(cars)s cars "
                "in a heat. Each pair races twice, swapping start positions. One point per car beaten in "
                "a heat. Ranked by points, then by the average lap in all heats."
            ) % {"limit": settings.DUELS_IN_ROUND_ROBIN, "cars": race.duel_cars}
        return f"{qualifying} {duels}"


def _bracket_rule(race: Race) -> str:
    if race.duel_heats == 1:
        return _(
            "After closing, the best %(limit)s classified cars meet in a knock-out bracket, seeded "
            "by qualifying. Each duel is one heat with the better qualifier in front. Ranked by "
            "duels won (a bye counts), then by the average lap in all heats."
        )
    if race.duel_heats == 3:
        return _(
            "After closing, the best %(limit)s classified cars meet in a knock-out bracket, seeded "
            "by qualifying. Each duel is best of three heats: two with swapped start positions and, "
            "at one win each, a third with the better car in front. Ranked by duels won (a bye "
            "counts), then by the average lap in all heats."
        )
    return _(
        "After closing, the best %(limit)s classified cars meet in a knock-out bracket, seeded "
        "by qualifying. Each duel has two heats with swapped start positions. More points win, "
        "then more laps, then less time, then the better qualifier. Ranked by duels won (a bye "
        "counts), then by the average lap in all heats."
    )


RULES: dict[str, RankingRule] = {rule.code: rule for rule in (Average(), Best(), Total())}
DUELS: dict[str, RankingRule] = {code: Points(rule) for code, rule in RULES.items()}


def rule_for(race: Race) -> RankingRule:
    """The ranking method of ``race``."""
    return (DUELS if race.opponents == "models" else RULES)[race.ranking_method]


def laps_needed(race: Race) -> int:
    """Complete laps in a row that classify a car in ``race``."""
    return race.minimum_laps


def standing_in(race: Race, laps: Sequence[Lap], *, is_live: bool = False) -> Standing:
    """What ``laps`` are worth in ``race``; ``is_live``: driven in its live event."""
    standing = rule_for(race).standing(laps, laps_needed(race))
    return replace(standing, is_live=True) if is_live else standing


def drawn_rank(points: int, lap_ms: int | None, seed: int) -> tuple[int, int]:
    """``rank_score`` and ``rank_lap`` of an entry in duels: more points first, then the lower average lap, then the
    better seed. All of them stand before anybody's qualifying, whose scores are not negative."""
    return -1 - points, (NO_LAP_MS if lap_ms is None else lap_ms) * SEEDS + seed


def order_rule(race: Race) -> str:
    """How ties are broken in ``race`` and where unclassified cars stand, in the reader's language."""
    rule = _(
        "Ties: faster best lap, then fewer resets, then the earlier submission. Cars that are "
        "not classified come last, by distance."
    )
    if race.opponents != "models":
        return rule
    duels = _("At equal points and average laps, the better qualifier is ahead. Cars without duels come last.")
    return f"{duels} {_('Qualifying: %(rule)s') % {'rule': rule}}"


def best_of_sectors(sectors: Any) -> tuple[int, ...]:
    """The lowest time of each sector over several laps' ``sectors``; laps without sector times are left out."""
    timed = [lap for lap in sectors if lap]
    return tuple(min(times) for times in zip(*timed, strict=True)) if timed else ()


def longest_streak(laps: Sequence[Lap]) -> int:
    """The most complete laps in a row."""
    longest = streak = 0
    for lap in laps:
        streak = streak + 1 if lap["complete"] else 0
        longest = max(longest, streak)
    return longest


def _sectors(lap: Lap) -> tuple[int, ...]:
    sectors = tuple(lap.get("sector_ms") or ())
    return () if any(time is None for time in sectors) else sectors


def _total(laps: Sequence[Lap]) -> int:
    return sum(lap["time_ms"] for lap in laps)


def _best_window(laps: Sequence[Lap], size: int) -> int | None:
    """Where the fastest ``size`` consecutive complete laps begin; the earliest of equals; None if there are none."""
    best, best_ms = None, 0
    for start in range(len(laps) - size + 1):
        window = laps[start : start + size]
        if all(lap["complete"] for lap in window):
            time_ms = _total(window)
            if best is None or time_ms < best_ms:
                best, best_ms = start, time_ms
    return best
