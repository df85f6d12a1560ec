"""The result of a finished run in its race: a few queries, whose cost does not grow with the board."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from django.db.models import Q, QuerySet, Subquery

from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from evaluation.models import Result

from ...models import Duel, DuelCompetitor, DuelFormat, Entry, Race, Submission
from ..improvement import Change, change
from ..ranking import Lap, Standing, longest_streak, standing_in
from .board import CLASSIFIED, ORDER, board_entries, ranks_of
from .counts import BoardTotals, totals_of


@dataclass(frozen=True)
class Rival:
    """A racer ahead on the board. ``gap``: milliseconds behind them, or where duels were drawn points (in a bracket
    ties); None where the two are not ranked by the same thing, or points are equal."""

    entry: Entry
    gap: int | None


@dataclass(frozen=True)
class Place:
    """Where an entry stands now. ``rank``: None for unclassified or withdrawn entries and house cars; ``ahead``: the
    next racer above; ``leader``: None for the leader."""

    entry: Entry
    rank: int | None
    totals: BoardTotals
    ahead: Rival | None
    leader: Rival | None

    @property
    def race(self) -> Race:
        return self.entry.race

    @property
    def is_drawn(self) -> bool:
        return self.entry.seed is not None

    @property
    def counts_ties(self) -> bool:
        """Whether the points are a bracket's ties won."""
        return self.race.duel_format == DuelFormat.BRACKET


@dataclass(frozen=True)
class RunResult:
    """A finished run of a submission. ``place``: by the counted run, which may be another one. ``earlier``: number of
    the best submission before; it and ``change`` are None for readers who may not know. ``streak``: complete laps in a
    row."""

    submission: Submission
    standing: Standing
    place: Place
    streak: int
    earlier: int | None
    change: Change | None

    @property
    def race(self) -> Race:
        return self.place.race

    @property
    def counts(self) -> bool:
        """Whether the racer's standing is of this run."""
        return self.place.entry.best_id == self.submission.pk

    @property
    def instead(self) -> Submission | None:
        """The counted run, if it is another one."""
        return None if self.counts else self.place.entry.best

    @property
    def is_held(self) -> bool:
        """Whether it waits for the other runs of its race to be driven again with its engine."""
        return self.submission.evaluation.result.engine != self.race.engine

    @property
    def was_overtaken(self) -> bool:
        """Whether it counted until a later car of the same racer was better."""
        return not self.is_held and self.instead is not None and self.instead.number > self.submission.number

    @property
    def came_late(self) -> bool:
        """Whether a better result changed nothing because the duels were drawn."""
        if self.counts or self.is_held or self.was_overtaken:
            return False
        return self.change is not None and self.change.is_better


@dataclass(frozen=True)
class HeatResult:
    """One car's share in a finished heat. ``place``: where its racer stands in the race now."""

    duel: Duel
    car: DuelCompetitor
    cars: int
    place: Place

    @property
    def race(self) -> Race:
        return self.place.race


def place_of(entry: Entry) -> Place:
    """Where an entry stands: three queries, shared by all readers. ``entry.race`` has been read."""

    def place() -> tuple[Any, ...]:
        rank = ranks_of([entry])[entry.pk]
        return rank, totals_of(entry.race), *_rivals(entry, rank)

    return Place(entry, *shared_value(("place", entry.pk), place))


def result_of(submission: Submission, laps: Sequence[Lap], *, with_earlier: bool) -> RunResult | None:
    """The result of a submission's finished run; None for a void submission. ``with_earlier``: for readers with access
    to all runs of the racer. ``submission.entry.race`` has been read."""
    if submission.is_void:
        return None
    race = submission.entry.race
    standing = standing_in(race, laps, is_live=submission.is_live)
    number, before = _best_earlier(submission) if with_earlier else (None, None)
    return RunResult(
        submission=submission,
        standing=standing,
        place=place_of(submission.entry),
        streak=longest_streak(laps),
        earlier=number,
        change=change(standing, before) if with_earlier else None,
    )


def heat_of(duel: Duel, racer_id: int) -> HeatResult | None:
    """The result of a decided heat for one of its racers: four queries. None until it is decided."""
    cars = list(DuelCompetitor.objects.filter(duel=duel).select_related("entry__racer"))
    mine = next((car for car in cars if car.entry.racer_id == racer_id and car.place is not None), None)
    if mine is None:
        return None
    mine.entry.race = duel.race
    return HeatResult(duel, mine, len(cars), place_of(mine.entry))


def _runs_before(entry: Any, number: Any, run: Any) -> QuerySet[Submission, tuple[int, bool, Sequence[Lap]]]:
    runs = Submission.objects.filter(entry_id=entry, number__lt=number, is_void=False)
    same_engine = Result.objects.filter(evaluation_id=run).values("engine")
    runs = runs.filter(evaluation__result__engine=Subquery(same_engine[:1])).order_by("number")
    return runs.values_list("number", "is_live", "evaluation__result__laps")


_earlier = KeptQuery(_runs_before)


def _best_earlier(submission: Submission) -> tuple[int | None, Standing | None]:
    """Number and standing of the racer's best submission before this one, of the same engine."""
    race = submission.entry.race
    number, best = None, None
    runs = _earlier(entry=submission.entry_id, number=submission.number, run=submission.evaluation_id)
    for one, is_live, laps in runs:
        standing = standing_in(race, laps, is_live=is_live)
        if best is None or standing.key < best.key:
            number, best = one, standing
    return number, best


def _rivals(entry: Entry, rank: int | None) -> tuple[Rival | None, Rival | None]:
    """The racer just ahead and the leader: one query, none for the leader and withdrawn entries."""
    if rank == 1 or entry.is_withdrawn:
        return None, None
    ranked = board_entries(entry.race).filter(CLASSIFIED, is_baseline=False)
    wanted = [ranked.values("pk")[:1]]
    if rank is not None:
        backwards = [f"-{name}" for name in ORDER]  # one by score, one among equals: an OR of both would read the board
        for before in (Q(rank_score__lt=entry.rank_score), Q(rank_score=entry.rank_score) & _before_equals(entry)):
            wanted.append(ranked.filter(before).order_by(*backwards).values("pk")[:1])
    found = Entry.objects.filter(pk__in=[Subquery(each) for each in wanted]).select_related("racer")
    rows = list(found.order_by(*ORDER))
    leader = next(iter(rows), None)
    return (
        None if rank is None or not rows else Rival(rows[-1], _gap(entry, rows[-1])),  # the last of those before it
        None if leader is None else Rival(leader, _gap(entry, leader)),
    )


def _before_equals(entry: Entry) -> Q:
    """Condition for the entries above this one with the same score."""
    before, same = Q(), Q()
    for name in ORDER[1:]:
        value = getattr(entry, name)
        before |= same & Q(**{f"{name}__lt": value})
        same &= Q(**{name: value})
    return before


def _gap(entry: Entry, other: Entry) -> int | None:
    if (entry.seed is None, entry.is_live) != (other.seed is None, other.is_live) or not entry.classified:
        return None
    if entry.seed is None:
        return (entry.score_ms or 0) - (other.score_ms or 0)
    return other.points - entry.points or None
