"""What screens of a live event draw beside its state: best sectors and the leader's run.

All of it is of runs that were revealed, so nothing here is of the future.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..models import LiveEvent, RankingMethod
from .live_runs import DrivenRun


@dataclass(frozen=True)
class Leader:
    """The best run so far: whole where the total counts, else its best lap, driven anew in each lap."""

    run: DrivenRun
    whole: bool


def leader_of(event: LiveEvent, runs: Iterable[DrivenRun]) -> Leader | None:
    """The run that leads, of those that are classified."""
    ranked = [run for run in runs if run.standing is not None and run.standing.classified]
    if not ranked:
        return None
    best = min(ranked, key=lambda run: run.standing.key)  # type: ignore[union-attr]
    return Leader(best, whole=event.race.ranking_method == RankingMethod.TOTAL)


def best_sectors(runs: Iterable[DrivenRun]) -> list[int | None]:
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


def best_sectors_by_racer(runs: Sequence[DrivenRun]) -> dict[str, list[int | None]]:
    """The same for each racer, by alias."""
    return {alias: best_sectors(run for run in runs if run.alias == alias) for alias in {run.alias for run in runs}}
