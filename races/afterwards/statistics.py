"""A live event in figures, of the runs that were shown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import Any

from ..models import LiveEvent
from ..ranking import best_of_sectors
from ..selectors.live import LiveRow, live_standings
from ..selectors.live_runs import DrivenRun, driven_runs, of_who_stayed


@dataclass(frozen=True)
class FastestLap:
    """The fastest complete lap: whose, in ms, and its number in its run."""

    racer: str
    time_ms: int
    lap: int


@dataclass(frozen=True)
class Gain:
    """Who came up farthest: from the place in qualifying to the one at the end."""

    racer: str
    before: int
    after: int

    @property
    def places(self) -> int:
        return self.before - self.after


@dataclass(frozen=True)
class RacerFigures:
    """The same of one racer. ``average_ms``: of the complete laps; ``speed_mps``: over them; both None without any."""

    racer: str
    rank: int | None
    runs: int
    laps: int
    best_lap_ms: int | None
    average_ms: int | None
    speed_mps: float | None
    off_tracks: int
    crashes: int
    resets: int


@dataclass(frozen=True)
class EventFigures:
    """A live event. ``laps``: complete ones; ``distance_m``: of them; ``driven_ms``: what was driven in all, penalties
    included; ``average_mps``: the speed over the complete laps. ``lead_changes``: how often a run put another racer in
    the lead; None for duels, where nobody leads by time. ``best_sectors``: each over all complete laps, ms."""

    runs: int
    without_result: int
    laps: int
    distance_m: float
    driven_ms: int
    average_mps: float | None
    fastest: FastestLap | None
    best_sectors: tuple[int, ...]
    off_tracks: int
    crashes: int
    resets: int
    lead_changes: int | None
    gain: Gain | None
    closest_ms: int | None
    racers: tuple[RacerFigures, ...]


def figures_of(event: LiveEvent, runs: Sequence[DrivenRun] | None = None) -> EventFigures:
    """The figures of what was shown so far; of an event of which nothing was, zeros and None."""
    runs = driven_runs(event) if runs is None else runs
    length = event.race.track.length_m or 0.0
    rows = live_standings(event)
    complete = [lap for run in runs for lap in run.complete]
    return EventFigures(
        runs=len(runs),
        without_result=sum(run.standing is None for run in runs),
        laps=len(complete),
        distance_m=len(complete) * length,
        driven_ms=sum(lap["time_ms"] for run in runs for lap in run.laps),
        average_mps=_speed(complete, length),
        fastest=_fastest(of_who_stayed(runs)),
        best_sectors=best_of_sectors(lap["sector_ms"] for lap in complete if lap.get("sector_ms")),
        **_faults(runs),
        lead_changes=lead_changes(runs) if all(run.slot.duel_id is None for run in runs) else None,
        gain=_gain(rows),
        closest_ms=_closest(rows),
        racers=tuple(_of_racer(row, runs, length) for row in rows),
    )


def lead_changes(runs: Iterable[DrivenRun]) -> int:
    """How often a run put another racer before who led until then. The first to be classified takes the lead from
    nobody, and who betters their own time keeps it."""
    best: dict[int, Any] = {}
    leader, changes = None, 0
    for run in runs:
        if run.standing is None:
            continue
        held = best.get(run.entry.pk)
        if held is None or run.standing.key < held.key:
            best[run.entry.pk] = run.standing
        ranked = [pk for pk, standing in best.items() if standing.classified]
        first = min(ranked, key=lambda pk: best[pk].key, default=None)
        changes += first is not None and leader is not None and first != leader
        leader = first
    return changes


def _fastest(runs: Iterable[DrivenRun]) -> FastestLap | None:
    """The earlier one of two that are equal."""
    laps = [FastestLap(run.alias, lap["time_ms"], lap["number"]) for run in runs for lap in run.complete]
    return min(laps, key=lambda lap: lap.time_ms, default=None)


def _gain(rows: Iterable[LiveRow]) -> Gain | None:
    gains = [
        Gain(row.racer.entry.shown_name, row.racer.qualified_rank, row.rank)
        for row in rows
        if row.rank is not None and row.racer.qualified_rank is not None and row.racer.qualified_rank > row.rank
    ]
    return max(gains, key=lambda gain: (gain.places, -gain.after), default=None)


def _closest(rows: Iterable[LiveRow]) -> int | None:
    """The smallest difference between two neighbours' scores, ms."""
    scores = [row.standing.score_ms for row in rows if row.rank and row.standing and row.standing.score_ms is not None]
    return min((after - before for before, after in pairwise(scores)), default=None)


def _of_racer(row: LiveRow, runs: Iterable[DrivenRun], length: float) -> RacerFigures:
    mine = [run for run in runs if run.entry.pk == row.racer.entry_id]
    complete = [lap for run in mine for lap in run.complete]
    times = [lap["time_ms"] for lap in complete]
    return RacerFigures(
        racer=row.racer.entry.shown_name,
        rank=row.rank,
        runs=len(mine),
        laps=len(complete),
        best_lap_ms=min(times, default=None),
        average_ms=round(fmean(times)) if times else None,
        speed_mps=_speed(complete, length),
        **_faults(mine),
    )


def _faults(runs: Iterable[DrivenRun]) -> dict[str, int]:
    laps = [lap for run in runs for lap in run.laps]
    return {name: sum(lap[name] for lap in laps) for name in ("off_tracks", "crashes", "resets")}


def _speed(complete: Sequence[dict[str, Any]], length: float) -> float | None:
    driven_s = sum(lap["time_ms"] for lap in complete) / 1000
    return len(complete) * length / driven_s if driven_s and length else None
