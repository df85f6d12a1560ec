"""What screens are told beside a live event's state, as data: sectors, the leader's run, reactions. All was shown."""

from __future__ import annotations

from typing import Any

from .models import LiveEvent
from .selectors.live_reactions import reactions_of
from .selectors.live_runs import of_who_stayed, shown_runs
from .selectors.live_screens import best_sectors, best_sectors_by_racer, leader_of


def screens_document(event: LiveEvent) -> dict[str, Any]:
    """``best_sectors``: of the event, and ``own_sectors``: of each racer by alias, in ms; ``leader``: whose run is
    driven beside as a ghost; ``reactions``: how often each was sent."""
    runs = of_who_stayed(shown_runs(event))
    leader = leader_of(event, runs)
    return {
        "best_sectors": best_sectors(runs),
        "own_sectors": best_sectors_by_racer(runs),
        "leader": None
        if leader is None or leader.run.standing is None
        else {
            "racer": leader.run.alias,
            "slot": leader.run.slot.pk,
            "whole": leader.whole,
            "lap": leader.run.standing.best_lap_number,
            "sectors": list(leader.run.standing.sectors),
        },
        "reactions": reactions_of(event),
    }
