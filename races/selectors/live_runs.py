"""The runs of a live event that were shown, car by car: of racers alone, and of heats of duels. Nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from evaluation.models import Evaluation, Result

from ..models import HEAT_CARS, Entry, LiveEvent, LiveSlot, SlotState
from ..ranking import Standing, standing_in


@dataclass(frozen=True)
class DrivenRun:
    """What a car drove in a slot that was shown. ``number``: the car's in its run; ``laps``: empty for a run without a
    result, whose ``standing`` is None."""

    slot: LiveSlot
    entry: Entry
    number: int
    laps: Sequence[dict[str, Any]]
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
    def complete(self) -> list[dict[str, Any]]:
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
    """The runs of racers alone, without heats of duels, the first first. Two queries."""
    slots = LiveSlot.objects.filter(event=event, state=SlotState.DONE, racer__isnull=False)
    found = list(slots.select_related("racer__entry__racer", "evaluation").order_by("done_at", "position", "pk"))
    results = Result.objects.filter(evaluation__in=[slot.evaluation_id for slot in found])
    laps: dict[int | None, list[dict[str, Any]]] = dict(results.values_list("evaluation", "laps"))
    return [
        _driven(event, slot, slot.racer.entry, 0, laps.get(slot.evaluation_id))
        for slot in found
        if slot.racer is not None
    ]


def of_who_stayed(runs: Sequence[DrivenRun]) -> list[DrivenRun]:
    """Those of racers who are still in the race: what somebody drove who was taken out leads nothing."""
    return [run for run in runs if not run.entry.is_withdrawn]


def _driven(
    event: LiveEvent, slot: LiveSlot, entry: Entry, number: int, laps: list[dict[str, Any]] | None
) -> DrivenRun:
    """``laps``: None where there is no result."""
    return DrivenRun(slot, entry, number, laps or [], None if laps is None else standing_in(event.race, laps))


def _run_of(slot: LiveSlot) -> int | None:
    """The evaluation that a slot showed; None for a walkover."""
    return slot.duel.evaluation_id if slot.duel is not None else slot.evaluation_id
