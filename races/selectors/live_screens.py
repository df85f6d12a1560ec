"""What screens of a live event draw beside its state: best sectors, the leader's run, the runs that were shown.

All of it is of runs that were revealed, so nothing here is of the future.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from evaluation.models import Result

from ..models import LiveEvent, LiveSlot, RankingMethod, SlotState
from ..ranking import Standing, standing_in


@dataclass(frozen=True)
class ShownRun:
    """A run that was shown. ``laps``: as it drove them, empty for a car that failed; ``standing``: None for that."""

    slot: LiveSlot
    laps: Sequence[dict[str, Any]]
    standing: Standing | None

    @property
    def alias(self) -> str:
        assert self.slot.racer is not None
        return self.slot.racer.entry.racer.alias


@dataclass(frozen=True)
class Leader:
    """The best run so far: whole where the total counts, else its best lap, driven anew in each lap."""

    run: ShownRun
    whole: bool


def shown_runs(event: LiveEvent) -> list[ShownRun]:
    """The runs that were revealed, the first first. Two queries."""
    slots = LiveSlot.objects.filter(event=event, state=SlotState.DONE, racer__isnull=False)
    slots = slots.select_related("racer__entry__racer", "evaluation").order_by("done_at", "position", "pk")
    found = list(slots)
    results = Result.objects.filter(evaluation__in=[slot.evaluation_id for slot in found])
    laps: dict[int | None, list] = dict(results.values_list("evaluation", "laps"))
    return [
        ShownRun(
            slot,
            laps.get(slot.evaluation_id, []),
            standing_in(event.race, laps[slot.evaluation_id]) if slot.evaluation_id in laps else None,
        )
        for slot in found
    ]


def leader_of(event: LiveEvent, runs: Iterable[ShownRun]) -> Leader | None:
    """The run that leads, of those that are classified."""
    ranked = [run for run in runs if run.standing is not None and run.standing.classified]
    if not ranked:
        return None
    best = min(ranked, key=lambda run: run.standing.key)  # type: ignore[union-attr]
    return Leader(best, whole=event.race.ranking_method == RankingMethod.TOTAL)


def best_sectors(runs: Iterable[ShownRun]) -> list[int | None]:
    """The best time in each sector, over all complete laps of these runs, in ms."""
    best: list[int | None] = []
    for run in runs:
        for sector, time_ms in enumerate(run.standing.best_sectors if run.standing is not None else ()):
            if sector == len(best):
                best.append(time_ms)
            else:
                held = best[sector]
                best[sector] = time_ms if held is None else min(held, time_ms)
    return best


def best_sectors_by_racer(runs: Sequence[ShownRun]) -> dict[str, list[int | None]]:
    """The same for each racer, by alias."""
    return {alias: best_sectors(run for run in runs if run.alias == alias) for alias in {run.alias for run in runs}}
