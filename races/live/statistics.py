"""Figures of a live event from its shown runs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean
from typing import Annotated, Any

from django.utils.translation import gettext as _
from django.utils.translation import ngettext

from core.times import clock

from ..boards.ranking import Lap, best_of_sectors
from ..models import LiveEvent
from .selectors.events import LiveRow, live_standings
from .selectors.runs import DrivenRun, driven_runs, without_withdrawn


@dataclass(frozen=True)
class FastestLap:
    """The fastest complete lap."""

    racer: str
    time_ms: int
    lap: Annotated[int, "Its number in its run, from 1."]


@dataclass(frozen=True)
class Gain:
    """The racer who gained the most places since qualifying."""

    racer: str
    before: Annotated[int, "Place in qualifying."]
    after: Annotated[int, "Place at the end."]

    @property
    def places(self) -> int:
        return self.before - self.after


@dataclass(frozen=True)
class RacerFigures:
    """One racer in figures."""

    racer: str
    rank: int | None
    runs: int
    laps: Annotated[int, "Complete ones."]
    best_lap_ms: int | None
    average_ms: Annotated[int | None, "Of the complete laps."]
    speed_mps: Annotated[float | None, "Over the complete laps."]
    off_tracks: int
    crashes: int
    resets: int


@dataclass(frozen=True)
class LiveFigures:
    """A live event in figures."""

    runs: int
    without_result: Annotated[int, "Runs that ended without one."]
    laps: Annotated[int, "Complete ones."]
    distance_m: Annotated[float, "Of the complete laps."]
    driven_ms: Annotated[int, "In all, penalties included."]
    average_mps: Annotated[float | None, "Speed over the complete laps."]
    fastest: FastestLap | None
    best_sectors: Annotated[tuple[int, ...], "Over all complete laps, in ms."]
    off_tracks: int
    crashes: int
    resets: int
    lead_changes: Annotated[int | None, "null for duels, where nobody leads by time."]
    gain: Annotated[Gain | None, "Who came up farthest from their place in qualifying."]
    closest_ms: Annotated[int | None, "The smallest gap between two neighbours."]
    racers: Annotated[tuple[RacerFigures, ...], "In the order of the standings."]


def figures_of(event: LiveEvent) -> LiveFigures:
    """The figures of the runs shown so far; zeros and None before the first."""
    runs = driven_runs(event)
    length = event.race.track.length_m or 0.0
    rows = live_standings(event)
    complete = [lap for run in runs for lap in run.complete]
    return LiveFigures(
        runs=len(runs),
        without_result=sum(run.standing is None for run in runs),
        laps=len(complete),
        distance_m=len(complete) * length,
        driven_ms=sum(lap["time_ms"] for run in runs for lap in run.laps),
        average_mps=_speed(complete, length),
        fastest=_fastest(without_withdrawn(runs)),
        best_sectors=best_of_sectors(lap["sector_ms"] for lap in complete if lap.get("sector_ms")),
        **_faults(runs),
        lead_changes=lead_changes(runs) if all(run.slot.duel_id is None for run in runs) else None,
        gain=_gain(rows),
        closest_ms=_closest(rows),
        racers=tuple(_of_racer(row, runs, length) for row in rows),
    )


def lead_changes(runs: Iterable[DrivenRun]) -> int:
    """How often a run changed the leader. The first leader does not count, nor does a leader's improvement."""
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


def _speed(complete: Sequence[Lap], length: float) -> float | None:
    driven_s = sum(lap["time_ms"] for lap in complete) / 1000
    return len(complete) * length / driven_s if driven_s and length else None


def figure_words(figures: LiveFigures) -> list[tuple[str, str]]:
    """(name, value) of each available figure, in the active language."""
    runs = ngettext("%(count)s run", "%(count)s runs", figures.runs) % {"count": figures.runs}
    if figures.without_result:
        runs += ", " + _("%(count)s without a result") % {"count": figures.without_result}
    rows = [
        (_("Driven"), runs),
        (_("Complete laps"), f"{figures.laps} ({figures.distance_m / 1000:.2f} km)"),
    ]
    if figures.fastest is not None:
        of = figures.fastest
        rows.append((_("Fastest lap"), f"{clock(of.time_ms)} · {of.racer} · " + _("lap %(lap)s") % {"lap": of.lap}))
    if figures.best_sectors:
        rows.append((_("Best sectors"), " · ".join(f"{each / 1000:.3f}" for each in figures.best_sectors)))
    if figures.average_mps is not None:
        rows.append((_("Average speed"), f"{figures.average_mps:.2f} m/s"))
    rows.append((_("Off tracks"), str(figures.off_tracks)))
    rows.append((_("Crashes"), str(figures.crashes)))
    rows.append((_("Resets"), str(figures.resets)))
    if figures.lead_changes is not None:
        rows.append((_("Changes of the lead"), str(figures.lead_changes)))
    if figures.gain is not None:
        moved = _("%(racer)s, from place %(before)s to %(after)s")
        rows.append((_("Biggest gain"), moved % vars(figures.gain)))
    if figures.closest_ms is not None:
        rows.append((_("Closest places"), f"{figures.closest_ms / 1000:.3f} s"))
    return rows
