"""The shown runs of a live event, car by car, and facts about its racers for the commentator."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import combinations, groupby

from accounts.models import Viewer
from evaluation.models import Evaluation, Result

from ...boards.ranking import Lap, Standing, best_of_sectors, standing_in
from ...entries.selectors.visibility import races_visible_to
from ...models import HEAT_CARS, Entry, LiveEvent, LiveRacer, LiveSlot, SlotState
from .events import LiveRow, live_standings


@dataclass(frozen=True)
class DrivenRun:
    """A car's run in a shown slot. ``number``: the car's number in the run; ``laps``: empty without a result, as
    ``standing`` is then None."""

    slot: LiveSlot
    entry: Entry
    number: int
    laps: Sequence[Lap]
    standing: Standing | None

    @property
    def alias(self) -> str:
        return self.entry.shown_name

    @property
    def evaluation(self) -> Evaluation:
        """Its run: of a heat the same for all cars."""
        driven = self.slot.duel.evaluation if self.slot.duel is not None else self.slot.evaluation
        assert driven is not None, "its slot was shown with a run"
        return driven

    @property
    def complete(self) -> list[Lap]:
        """The laps that were finished."""
        return [lap for lap in self.laps if lap["complete"]]


def driven_runs(event: LiveEvent) -> list[DrivenRun]:
    """Every car of every slot that was shown, in the order in which they were. Four queries."""
    related = ("racer__entry__racer", "racer__entry__race", "duel__evaluation", "evaluation")
    slots = LiveSlot.objects.filter(event=event, state=SlotState.DONE).select_related(*related)
    found = list(slots.prefetch_related(HEAT_CARS).order_by("done_at", "position", "pk"))
    runs = {slot.pk: _run_of(slot) for slot in found}
    results = Result.objects.filter(evaluation__in=[run for run in runs.values() if run is not None])
    laps: dict[int | None, dict[int, list]] = {}
    for result in results.only("evaluation", "laps").prefetch_related("rivals"):
        laps[result.evaluation_id] = {0: result.laps, **{each.number: each.laps for each in result.rivals.all()}}
    return [
        _driven(event, slot, entry, number, driven)
        for slot in found
        if runs[slot.pk] is not None
        for number, entry in enumerate(slot.starting)
        for driven in (laps.get(runs[slot.pk], {}).get(number),)
    ]


def shown_runs(event: LiveEvent) -> list[DrivenRun]:
    """The runs of single racers, without heats of duels, earliest first. Two queries."""
    slots = LiveSlot.objects.filter(event=event, state=SlotState.DONE, racer__isnull=False)
    found = list(slots.select_related("racer__entry__racer", "evaluation").order_by("done_at", "position", "pk"))
    results = Result.objects.filter(evaluation__in=[slot.evaluation_id for slot in found])
    laps: dict[int | None, list[Lap]] = dict(results.values_list("evaluation", "laps"))
    return [
        _driven(event, slot, slot.racer.entry, 0, laps.get(slot.evaluation_id))
        for slot in found
        if slot.racer is not None
    ]


def without_withdrawn(runs: Sequence[DrivenRun]) -> list[DrivenRun]:
    """The runs of racers who are still in the race; those of withdrawn racers cannot lead."""
    return [run for run in runs if not run.entry.is_withdrawn]


def leader_of(runs: Iterable[DrivenRun]) -> DrivenRun | None:
    """The leading run among those that are classified."""
    ranked = [(run.standing.key, run) for run in runs if run.standing is not None and run.standing.classified]
    return min(ranked, key=lambda each: each[0])[1] if ranked else None


def best_sectors(runs: Iterable[DrivenRun]) -> list[int]:
    """The best time in each sector, over all complete laps of these runs, in ms."""
    return list(best_of_sectors(run.standing.best_sectors for run in runs if run.standing is not None))


def best_sectors_by_racer(runs: Sequence[DrivenRun]) -> dict[str, list[int]]:
    """The same for each racer, by alias."""
    return {alias: best_sectors(run for run in runs if run.alias == alias) for alias in {run.alias for run in runs}}


def _driven(event: LiveEvent, slot: LiveSlot, entry: Entry, number: int, laps: list[Lap] | None) -> DrivenRun:
    """``laps``: None where there is no result."""
    return DrivenRun(slot, entry, number, laps or [], None if laps is None else standing_in(event.race, laps))


def _run_of(slot: LiveSlot) -> int | None:
    """The evaluation that a slot showed; None for a walkover."""
    return slot.duel.evaluation_id if slot.duel is not None else slot.evaluation_id


MOST_RACERS = 16  # of a table of all against all
MOST_RESULTS = 4000


@dataclass(frozen=True)
class Facts:
    """A racer: how they stand, their best sectors (ms) and what went wrong in the runs that were shown."""

    row: LiveRow
    sectors: list[int]
    off_tracks: int
    crashes: int


@dataclass(frozen=True)
class Met:
    """Earlier races that both finished: how often ``racer`` was before each other one. None with itself."""

    racer: str
    against: list[tuple[int, int] | None]


def facts_of(event: LiveEvent) -> list[Facts]:
    """Of every racer in the running order, as they stand."""
    runs = shown_runs(event)
    by_racer: dict[int, list[DrivenRun]] = {}
    for run in runs:
        by_racer.setdefault(run.slot.racer_id or 0, []).append(run)
    found = []
    for row in live_standings(event):
        mine = by_racer.get(row.racer.pk, [])
        standings = [run.standing for run in mine if run.standing]
        off_tracks, crashes = sum(one.off_tracks for one in standings), sum(one.crashes for one in standings)
        found.append(Facts(row, best_sectors(mine), off_tracks, crashes))
    return found


def met_before(event: LiveEvent, reader: Viewer, now: datetime) -> list[Met]:
    """The first sixteen racers against each other, in races that are closed and that the reader may see."""
    racers = LiveRacer.objects.filter(event=event).select_related("entry__racer").order_by("qualified_rank", "pk")
    rivals = [racer.entry.racer for racer in racers[:MOST_RACERS]]
    races = races_visible_to(reader).filter(cancelled_at=None, closes_at__lte=now).exclude(pk=event.race_id).order_by()
    results = Entry.objects.filter(
        race__in=races.values("pk"), racer__in=rivals, classified=True, withdrawn_at=None, is_baseline=False
    ).order_by("-race", "rank_score", "rank_lap", "resets", "achieved_at", "pk")
    before: Counter[tuple[int, ...]] = Counter()
    found = results.values_list("race", "racer")[:MOST_RESULTS]
    for _race, rows in groupby(found, key=lambda row: row[0]):
        before.update(combinations((racer for _, racer in rows), 2))
    return [
        Met(
            one.alias,
            [None if one == other else (before[one.pk, other.pk], before[other.pk, one.pk]) for other in rivals],
        )
        for one in rivals
    ]
