"""Ranking methods, one class each, and the standings that they compute from laps (LapResult dicts, in milliseconds).

The average is the old service's (DRoA, ModelPerformanceMetricsHelper.ts): the lowest floor(mean) over every window of
so many consecutive complete laps as are needed. Unlike there, an unfinished lap is never a best lap. A race of duels
(``Points``) ranks by its method until they are drawn, then by points (races.duels.points).

Order on a board: classified cars by score, best lap, fewer resets, earlier submission; then unclassified ones by
distance; last the entries without a result.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from django.conf import settings
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy, ngettext

from paddock.rules.race import RANKING_METHODS

from ..ranks import LAST, LIVE_LEAD, MOST_DRIVEN, NO_LAP_MS, NOT_CLASSIFIED, SEEDS

if TYPE_CHECKING:
    from ..models import Race

Lap = Mapping[str, Any]


@dataclass(frozen=True)
class Standing:
    """The standing of one submission in a race. Times in milliseconds, None without the laps for it.

    ``window``: first and last lap of the average. ``total_ms``: if all laps are complete. ``driven_percent``: sum over
    all laps (300 = three laps). ``sectors``: of the best lap; ``best_sectors``: the best of each over all complete
    laps. ``is_live``: driven in the race's live event, which ranks above all other submissions.
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
        """Sort key of a submission, smaller is better; the earlier of equals comes first."""
        return self.rank_score, self.rank_lap, self.resets


@dataclass(frozen=True)
class Column:
    """A column of times on a board. ``figure``: the field of a :class:`Standing` (and of an entry); ``ranks``:
    whether the board is sorted by it; ``shown``: the CSS class of a column for wider pages only."""

    figure: str
    label: Any
    ranks: bool
    shown: str = ""


class RankingRule(ABC):
    """One ranking method, the smaller score first. To add one, write a subclass and decorate it with :func:`register`.

    The docstring of a subclass is the description of the score in the guides. ``code``: the name in rows, the API and
    commands; ``label``: in forms and lists; ``column``: heading of the score's column on a board; ``figure``: the
    figure of a :class:`Standing` that is the score, or ``score_ms`` where :meth:`score` computes it;
    ``needs_all_laps``: the score is the time of all laps; ``record``: the name in season files; ``record_column``:
    the column of their results that holds the score, if any does (races of duels need one).
    """

    code: str
    label: Any
    column: Any
    figure = "score_ms"
    needs_all_laps = False
    record: str
    record_column = ""

    def standing(self, laps: Sequence[Lap], needed: int) -> Standing:
        """The standing of ``laps``, classified with ``needed`` consecutive ones. Raises ValueError below 1."""
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
        """The ranking of ``race`` as a short text in the reader's language."""
        return str(self.column)

    def columns(self, race: Race) -> tuple[Column, ...]:
        """The columns of times on a board: the score, average and best lap, each once."""
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
        """The ranking rule of ``race`` and the conditions to be classified, as sentences in the reader's language."""


RULES: dict[str, RankingRule] = RANKING_METHODS
LONGEST_CODE = 7  # the length of the columns


def register(kind: type[RankingRule]) -> type[RankingRule]:
    """Add a ranking method. Raises ValueError if its names are too long or taken."""
    if len(kind.code) > LONGEST_CODE:
        raise ValueError(f"the code of a ranking method has at most {LONGEST_CODE} letters, unlike {kind.code}")
    if kind.code in RULES or kind.record in {rule.record for rule in RULES.values()}:
        raise ValueError(f"another ranking method has the name {kind.code} or {kind.record}")
    RULES[kind.code] = kind()
    return kind


@register
class Average(RankingRule):
    """The lowest average over any window of N consecutive complete laps, rounded down to the millisecond."""

    code = "average"
    label = gettext_lazy("average lap")
    column = gettext_lazy("Average")
    figure = "average_ms"
    record, record_column = "avg_lap_time", "AvgLapTime"

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


@register
class Best(RankingRule):
    """The fastest complete lap."""

    code = "best"
    label = gettext_lazy("best lap")
    column = gettext_lazy("Best lap")
    figure = "best_lap_ms"
    record, record_column = "best_lap_time", "BestLapTime"

    def rule(self, race: Race) -> str:
        laps = laps_needed(race)
        return ngettext(
            "Ranked by the fastest complete lap. Cars without a complete lap are not classified.",
            "Ranked by the fastest complete lap. Cars without %(laps)s consecutive laps are not classified.",
            laps,
        ) % {"laps": laps}


@register
class Total(RankingRule):
    """The time of all laps."""

    code = "total"
    label = gettext_lazy("total time")
    column = gettext_lazy("Total")
    figure = "total_ms"
    needs_all_laps = True
    record, record_column = "total_time", "TotalLapTime"

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


def rule_for(race: Race) -> RankingRule:
    """The ranking method of ``race``."""
    rule = RULES[race.ranking_method]
    return Points(rule) if race.opponents == "models" else rule


def laps_needed(race: Race) -> int:
    """Complete laps in a row that classify a car in ``race``."""
    return race.minimum_laps


def standing_in(race: Race, laps: Sequence[Lap], *, is_live: bool = False) -> Standing:
    """The standing of ``laps`` in ``race``; ``is_live``: driven in its live event."""
    standing = rule_for(race).standing(laps, laps_needed(race))
    return replace(standing, is_live=True) if is_live else standing


def drawn_rank(points: int, lap_ms: int | None, seed: int) -> tuple[int, int]:
    """``rank_score`` and ``rank_lap`` of an entry in duels: points, average lap, seed; before any qualifying score."""
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
