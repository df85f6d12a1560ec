"""The replay of a live event: for each run the spectators' documents during and after it; the page has the clock."""

from collections.abc import Sequence
from datetime import datetime
from typing import TypedDict

from paddock.errors import UserFault

from ..live.document import (
    LiveEventDocument,
    LiveLeaderDocument,
    LiveStandingDocument,
    leader_document,
    live_document,
    row_document,
    slot_document,
)
from ..live.selectors.events import LiveRow, live_racers, rows_by_time
from ..live.selectors.runs import DrivenRun, best_sectors, best_sectors_by_racer, driven_runs
from ..models import (
    DuelCompetitor,
    LiveEvent,
    LiveRacer,
    LiveState,
    Opponents,
    SlotPhase,
)

NEXT = 3


class AgainStep(TypedDict):
    """A run: the states while it is played and after it."""

    state: LiveEventDocument
    after: LiveEventDocument


class AgainDocument(TypedDict):
    """The replay. ``end``: the state with the podium."""

    steps: list[AgainStep]
    end: LiveEventDocument


class ShownDocument(TypedDict):
    """The part of a state that the shown runs decide."""

    standings: list[LiveStandingDocument]
    best_sectors: list[int]
    own_sectors: dict[str, list[int]]
    leader: LiveLeaderDocument | None


def require_ended(event: LiveEvent) -> None:
    """Raises UserFault("results_not_yet")."""
    if event.state != LiveState.ENDED:
        raise UserFault("results_not_yet")


def again_document(event: LiveEvent, now: datetime) -> AgainDocument:
    """For each shown run its states (:func:`races.live.document.live_document`), and the state with the podium. Raises
    UserFault("results_not_yet")."""
    require_ended(event)
    last = live_document(event, now) | {"message": "", "order": [], "next": [], "reactions": {}}
    runs = driven_runs(event)
    slots = list(dict.fromkeys(run.slot for run in runs))
    documents = [
        slot_document(slot, now, on_track=True) | {"state": SlotPhase.ON_TRACK.value, "evaluation": None}
        for slot in slots
    ]
    racers = live_racers(event)
    steps: list[AgainStep] = []
    for number, slot in enumerate(slots):
        before = [run for run in runs if run.slot in slots[:number]]
        quiet = last | {"phase": LiveState.RUNNING.value, "podium": [], "winner": None, "current": None, "bracket": []}
        coming = [each | {"state": "waiting"} for each in documents[number + 1 : number + 1 + NEXT]]
        since = [*before, *(run for run in runs if run.slot == slot)]
        current = documents[number]
        state: LiveEventDocument = {**quiet, **_standing(event, before, racers), "current": current, "next": coming}
        after: LiveEventDocument = {**quiet, **_standing(event, since, racers), "next": coming}
        steps.append({"state": state, "after": after})
    return {"steps": steps, "end": last | {"current": None}}


def _standing(event: LiveEvent, runs: Sequence[DrivenRun], racers: Sequence[LiveRacer]) -> ShownDocument:
    """How the event stood when these runs had been shown, with the sectors and the leader of screens."""
    if event.race.opponents == Opponents.MODELS:
        rows = _by_points(runs, racers)
        return {"standings": rows, "best_sectors": [], "own_sectors": {}, "leader": None}
    by_time = rows_by_time(racers, [(run.entry.pk, run.standing) for run in runs])
    return {
        "standings": [row_document(row) for row in by_time],
        "best_sectors": best_sectors(runs),
        "own_sectors": best_sectors_by_racer(runs),
        "leader": leader_document(event, runs),
    }


def _by_points(runs: Sequence[DrivenRun], racers: Sequence[LiveRacer]) -> list[LiveStandingDocument]:
    """The standings by points of the shown heats, without ranks before the first."""
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
