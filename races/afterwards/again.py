"""A live event to be watched again: what spectators' pages were told, run by run, for a clock of the page's own.

All of it is public by then. Each step is what the page shows while a run is played and just after it; nothing of a
later one is drawn before its turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from paddock.errors import UserFault

from ..live_document import live_document, row_document, slot_document
from ..models import (
    PLAYED_BEHIND,
    REVEALED_AFTER,
    DuelCompetitor,
    LiveEvent,
    LiveRacer,
    LiveState,
    Opponents,
    SlotPhase,
)
from ..selectors.live import LiveRow, live_racers, rows_by_time
from ..selectors.live_runs import DrivenRun, driven_runs
from ..selectors.live_screens import Leader, best_sectors, best_sectors_by_racer, leader_of

COUNTDOWN_MS = 5_000
BETWEEN_MS = 4_000  # how long the standings after a run stay before the next is announced
NEXT = 3


def require_ended(event: LiveEvent) -> None:
    """Raises UserFault("results_not_yet")."""
    if event.state != LiveState.ENDED:
        raise UserFault("results_not_yet")


def again_document(event: LiveEvent, now: datetime) -> dict[str, Any]:
    """``{"steps": [...], "end": state}``: for each run that was shown ``{"state", "after", "starts_ms", "ends_ms"}``
    with the states of :func:`races.live_document.live_document` while it is played and after it, and when it begins
    and ends on the page's clock, which begins at 0. ``end``: the state with the podium.

    Raises UserFault("results_not_yet").
    """
    require_ended(event)
    last = live_document(event, now) | {"message": "", "order": [], "next": [], "reactions": {}}
    runs = driven_runs(event)
    slots = list(dict.fromkeys(run.slot for run in runs))
    told = [slot_document(slot, now) | {"state": SlotPhase.ON_TRACK.value, "evaluation": None} for slot in slots]
    racers = live_racers(event)
    steps, at = [], 0
    for number, slot in enumerate(slots):
        before = [run for run in runs if run.slot in slots[:number]]
        starts_ms = at + COUNTDOWN_MS
        assert slot.starts_at is not None
        assert slot.ends_at is not None
        played = slot.ends_at - slot.starts_at + PLAYED_BEHIND + REVEALED_AFTER
        ends_ms = starts_ms + round(played.total_seconds() * 1000)
        quiet = last | {"phase": LiveState.RUNNING.value, "podium": [], "winner": None, "current": None, "bracket": []}
        coming = [each | {"state": "waiting"} for each in told[number + 1 : number + 1 + NEXT]]
        current = told[number] | {"starts_at": starts_ms}
        state = quiet | _standing(event, before, racers) | {"current": current, "next": coming}
        after = quiet | _standing(event, [*before, *(run for run in runs if run.slot == slot)], racers)
        steps.append({"state": state, "after": after | {"next": coming}, "starts_ms": starts_ms, "ends_ms": ends_ms})
        at = ends_ms + BETWEEN_MS
    return {"steps": steps, "end": last | {"current": None}}


def _standing(event: LiveEvent, runs: Sequence[DrivenRun], racers: Sequence[LiveRacer]) -> dict[str, Any]:
    """How the event stood when these runs had been shown, with the sectors and the leader of screens."""
    if event.race.opponents == Opponents.MODELS:
        rows = _by_points(runs, racers)
        return {"standings": rows, "best_sectors": [], "own_sectors": {}, "leader": None}
    leader = leader_of(event, runs)
    by_time = rows_by_time(racers, [(run.entry.pk, run.standing) for run in runs])
    return {
        "standings": [row_document(row) for row in by_time],
        "best_sectors": best_sectors(runs),
        "own_sectors": best_sectors_by_racer(runs),
        "leader": None if leader is None else _leader(leader),
    }


def _leader(leader: Leader) -> dict[str, Any] | None:
    standing = leader.run.standing
    if standing is None:
        return None
    return {
        "racer": leader.run.alias,
        "slot": leader.run.slot.pk,
        "whole": leader.whole,
        "lap": standing.best_lap_number,
        "sectors": list(standing.sectors),
    }


def _by_points(runs: Sequence[DrivenRun], racers: Sequence[LiveRacer]) -> list[dict[str, Any]]:
    """By the points of the heats that were shown; before the first nobody has a rank."""
    heats = {run.slot.duel_id for run in runs}
    points: dict[int, int] = {}
    driven: dict[int, int] = {}
    for car in DuelCompetitor.objects.filter(duel__in=heats):
        points[car.entry_id] = points.get(car.entry_id, 0) + (car.points or 0)
        driven[car.entry_id] = driven.get(car.entry_id, 0) + 1
    order = sorted(racers, key=lambda each: (-points.get(each.entry_id, 0), each.pk))
    return [
        row_document(
            LiveRow(
                each,
                place if heats else None,
                None,
                driven.get(each.entry_id, 0),
                None,
                points.get(each.entry_id, 0),
            )
        )
        for place, each in enumerate(order, start=1)
    ]
