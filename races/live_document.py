"""A live event as data: what spectators' pages, screens and programs are told of it. Nothing in it is of the future."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from .live_rules import seed, start_m
from .live_screens import screens_document
from .models import PLAYED_BEHIND, Entry, LiveEvent, LiveRacer, LiveSlot, LiveState, Opponents, SlotState
from .poses import CHUNK_MS
from .ranking import Standing
from .selectors.duels import DuelRound, duels_of
from .selectors.live import (
    PODIUM,
    LiveRow,
    duels_are_open,
    live_racers,
    live_standings,
    on_track,
    phase_of,
    running_order,
    up_next,
)
from .selectors.live_speed import present_speed


def milliseconds(time: datetime | None) -> int | None:
    """A time as browsers count: whole milliseconds since 1970."""
    return None if time is None else round(time.timestamp() * 1000)


def live_document(event: LiveEvent, now: datetime) -> dict[str, Any]:
    """The event as everybody who may see it is told of it; times in ms since 1970 by the server's clock."""
    slots = running_order(event)
    playing = on_track(slots)
    standings = live_standings(event)
    phase = phase_of(event, now)
    begun = event.begun_at is not None
    return {
        "race": event.race.slug,
        "name": event.race.name,
        "phase": phase,
        "version": event.version,
        "now": milliseconds(now),
        "starts_at": milliseconds(event.starts_at),
        "time_zone": event.time_zone,
        "lobby_opens_at": milliseconds(event.lobby_opens_at),
        "behind_ms": round(PLAYED_BEHIND.total_seconds() * 1000),
        "chunk_ms": CHUNK_MS,
        "rounds": event.rounds,
        "attempt_ms": event.attempt_ms,
        "start_m": start_m(event),
        "seed": seed(event),
        "speed_control": event.speed_control,
        "submissions_open": event.submissions_open and not event.is_over,
        "message": event.message,
        "current": None if playing is None else slot_document(playing, now),
        "next": [slot_document(slot, now) for slot in up_next(event, slots)],
        "order": [slot_document(slot, now) for slot in slots],
        "racers": []
        if begun
        else [_racer(racer) | {"here": racer.here_at is not None} for racer in live_racers(event)],
        "standings": [row_document(row) for row in standings],
        "bracket": bracket_document(event),
        "winner": None if (winner := _winner(event)) is None else winner.racer.alias,
        "podium": _podium(event, standings),
        **screens_document(event),
    }


def slot_document(slot: LiveSlot, now: datetime) -> dict[str, Any]:
    """A place in the running order. When a run ends is not told: it would say that a car is about to be taken off."""
    return {
        "slot": slot.pk,
        "round": slot.round,
        "attempt": slot.attempt,
        "state": slot.phase_at(now),
        "starts_at": milliseconds(slot.starts_at),
        "evaluation": _shown_run(slot),
        "reason": slot.reason_code,
        "speed": present_speed(slot, now),
        "heat": None if slot.duel is None else slot.duel.number,
        "cars": [
            {
                "number": number,
                "racer": entry.racer.alias,
                "country": str(entry.racer.country or ""),
                "speed": present_speed(slot, now, number),
            }
            for number, entry in enumerate(slot.starting)
        ],
        **(_racer(slot.racer) if slot.racer is not None else _heat(slot)),
    }


def _shown_run(slot: LiveSlot) -> str | None:
    """The public id of a run that was shown."""
    if slot.submission is not None:
        return slot.submission.evaluation.public_id
    duel = slot.duel if slot.state == SlotState.DONE else None
    # a heat names its run once it was shown
    return None if duel is None or duel.evaluation is None else duel.evaluation.public_id


def _heat(slot: LiveSlot) -> dict[str, Any]:
    return {"racer": slot.who, "country": "", "qualified_rank": None}


def bracket_document(event: LiveEvent) -> list[dict[str, Any]]:
    """The rounds of the event's duels as far as they were shown: in a bracket their ties (whom nobody knows yet is
    None), in a round robin their heats. Empty until they are drawn."""
    duels = duels_of(event.race) if event.race.opponents == Opponents.MODELS else None
    return [] if duels is None else [_round(one) for one in duels.rounds]


def _round(of: DuelRound) -> dict[str, Any]:
    ties = [
        {
            "number": tie.tie.number,
            "bye": tie.tie.bye,
            "cars": [
                {
                    "racer": None if car.entry is None else car.entry.racer.alias,
                    "seed": None if car.entry is None else car.entry.seed,
                    "points": car.points,
                    "won": car.won,
                }
                for car in tie.cars
            ],
        }
        for tie in of.ties
    ]
    heats = [
        {
            "number": heat.duel.number,
            "state": heat.duel.state,
            "cars": [
                {"racer": car.entry.racer.alias, "place": car.place, "points": car.points} for car in heat.at_the_end
            ],
        }
        for heat in of.heats
    ]
    return {"round": of.number, "name": of.name, "ties": ties, "heats": heats}


def _racer(racer: LiveRacer) -> dict[str, Any]:
    of = racer.entry.racer
    return {"racer": of.alias, "country": str(of.country or ""), "qualified_rank": racer.qualified_rank}


def _in_lobby(racer: LiveRacer) -> dict[str, Any]:
    return {**_racer(racer), "here": racer.here_at is not None}


def row_document(row: LiveRow) -> dict[str, Any]:
    standing: Standing | None = row.standing
    return {
        "rank": row.rank,
        **_racer(row.racer),
        "attempts": row.attempts,
        "score_ms": None if standing is None else standing.score_ms,
        "gap_ms": row.gap_ms,
        "points": row.points,
        "best_lap_ms": None if standing is None else standing.best_lap_ms,
        "complete_laps": None if standing is None else standing.complete_laps,
        "sectors": [] if standing is None else list(standing.sectors),
    }


def _winner(event: LiveEvent) -> Entry | None:
    """Who has won; nobody, once they were taken out of the race."""
    return None if event.winner is None or event.winner.is_withdrawn else event.winner


def _podium(event: LiveEvent, standings: list[LiveRow]) -> list[str]:
    return [entry.racer.alias for entry in podium_entries(event, standings)]


def podium_entries(event: LiveEvent, standings: list[LiveRow]) -> list[Entry]:
    """The entries on the podium, the winner first; empty until it is shown, and of duels that were ended before their
    last."""
    winner = _winner(event)
    if event.podium_at is None or event.state == LiveState.CANCELLED or (winner is None and duels_are_open(event.race)):
        return []
    placed = [row.racer.entry for row in standings if row.rank is not None]
    if winner is not None:
        placed = [winner, *(entry for entry in placed if entry.pk != winner.pk)]
    return placed[:PODIUM]
