"""A live event as data for spectators' pages, screens and programs; it contains nothing of the future."""

from collections.abc import Iterable
from datetime import datetime
from typing import Annotated, TypedDict

from core.streams.shared_pieces import shared_value
from evaluation.models import Evaluation
from evaluation.running.competitors import live_cars

from ..boards.ranking import Standing
from ..duels.selectors import DuelRound, duels_of
from ..models import PLAYED_BEHIND, Entry, LiveEvent, LiveRacer, LiveSlot, LiveState, Opponents
from ..replays.document import look_document
from ..rules.live_start import seed, start_m
from .selectors import events
from .selectors.runs import DrivenRun, best_sectors, best_sectors_by_racer, leader_of, shown_runs, without_withdrawn
from .selectors.speed import SpeedCommandDocument, present_speed
from .streaming.pose_chunks import CHUNK_MS


class LiveRacerDocument(TypedDict):
    """A racer of the event."""

    racer: str
    country: str
    qualified_rank: Annotated[int | None, "Place in the race when the event began."]


class LiveLobbyRacerDocument(LiveRacerDocument):
    """A racer in the lobby."""

    here: Annotated[bool, "Whether they answered the roll call."]


class LiveCarDocument(TypedDict):
    """A car of a run."""

    number: int
    racer: str
    country: str
    look: Annotated[dict[str, str] | None, "Of the run on track: its shell, colour and drawing from above."]
    speed: Annotated[SpeedCommandDocument | None, "The command that it drives by now."]


class LiveSlotDocument(LiveRacerDocument):
    """A place in the running order."""

    slot: Annotated[int, "Its number, for acts and poses."]
    round: int
    attempt: Annotated[int, "More than 1 for a run that was run again."]
    state: Annotated[str, "waiting, called, countdown, on_track, done, skipped, held or removed."]
    starts_at: Annotated[int | None, "When it starts or started, in ms since 1970."]
    evaluation: Annotated[str | None, "The public_id of its run, once it was shown."]
    reason: Annotated[str, "A reason code, such as why it is held."]
    speed: Annotated[SpeedCommandDocument | None, "That of its first car."]
    heat: Annotated[int | None, "The number of the duel in its round; null without."]
    cars: Annotated[list[LiveCarDocument], "Who drives, by the numbers that the cars of its poses have."]


class LiveStandingDocument(LiveRacerDocument):
    """A racer's standing after the runs shown so far."""

    rank: int | None
    attempts: int
    score_ms: int | None
    gap_ms: Annotated[int | None, "To the leader's score."]
    best_lap_ms: int | None
    complete_laps: int | None
    sectors: Annotated[list[int], "Of the best lap, in ms."]
    points: Annotated[int | None, "In duels; in a bracket how many ties were won."]


class LiveTieCarDocument(TypedDict):
    """A place of a tie."""

    racer: Annotated[str | None, "null while nobody is known."]
    seed: int | None
    points: int | None
    won: bool


class LiveTieDocument(TypedDict):
    """Two who meet in a bracket."""

    number: int
    bye: Annotated[bool, "Nobody else will come: its one car goes on."]
    cars: list[LiveTieCarDocument]


class LiveHeatCarDocument(TypedDict):
    """A car of a duel."""

    racer: str
    place: int | None
    points: int | None


class LiveHeatDocument(TypedDict):
    """A duel."""

    number: int
    state: Annotated[str, "waiting until it was shown, then decided or void."]
    cars: Annotated[list[LiveHeatCarDocument], "In the order at the end once it was shown."]


class LiveRoundDocument(TypedDict):
    """A round of duels."""

    round: int
    name: str
    ties: Annotated[list[LiveTieDocument], "Of a bracket."]
    heats: list[LiveHeatDocument]


class LiveLeaderDocument(TypedDict):
    """The leading run, drawn as a ghost."""

    racer: str
    slot: Annotated[int, "Its poses are those of this place in the running order."]
    whole: Annotated[bool, "Whether the whole run counts, else its best lap."]
    lap: Annotated[int | None, "The number of its best lap."]
    sectors: Annotated[list[int], "Of that lap, in ms."]


class LiveEventDocument(TypedDict):
    """A live event. Times in milliseconds since 1970, by the server's clock."""

    race: Annotated[str, "The race's address."]
    name: str
    phase: Annotated[str, "planned, lobby, running, paused, ended or cancelled."]
    version: Annotated[int, "Counts what organisers did; acts name the one they saw."]
    now: int
    starts_at: int
    time_zone: str
    lobby_opens_at: int
    behind_ms: Annotated[int, "Play so much behind the clock, and you have what you play."]
    chunk_ms: Annotated[int, "How long a chunk of poses is."]
    rounds: int
    attempt_ms: int
    start_m: Annotated[float, "Laps begin and end so many metres after the race's finish line."]
    seed: Annotated[int, "Of the event's runs."]
    speed_control: Annotated[bool, "Whether racers set their car's speed."]
    submissions_open: Annotated[bool, "Whether racers choose their models."]
    message: Annotated[str, "To spectators."]
    current: Annotated[LiveSlotDocument | None, "What counts down or is played."]
    next: Annotated[list[LiveSlotDocument], "The next three."]
    order: Annotated[list[LiveSlotDocument], "The running order; empty until the event has begun."]
    racers: Annotated[list[LiveLobbyRacerDocument], "Who is in the lobby, until the event has begun."]
    standings: list[LiveStandingDocument]
    bracket: Annotated[list[LiveRoundDocument], "The rounds of duels as far as they were shown."]
    winner: str | None
    podium: Annotated[list[str], "Once it is shown; the winner first."]
    best_sectors: Annotated[list[int], "The best time in each sector, in ms, of the runs that were shown."]
    own_sectors: Annotated[dict[str, list[int]], "The same of each racer, by alias."]
    leader: LiveLeaderDocument | None
    reactions: Annotated[dict[str, int], "How often each was sent."]


def milliseconds(time: datetime) -> int:
    """A time as browsers count: whole milliseconds since 1970."""
    return round(time.timestamp() * 1000)


def shared_document(event: LiveEvent, now: datetime) -> LiveEventDocument:
    """:func:`live_document`, made once a second for all readers. Its ``now`` is exact."""
    key = "live document", event.pk, event.version
    return {**shared_value(key, lambda: live_document(event, now)), "now": milliseconds(now)}


def live_document(event: LiveEvent, now: datetime) -> LiveEventDocument:
    """The event as all its readers see it; times in ms since 1970 by the server's clock."""
    slots = events.running_order(event)
    playing = events.on_track(slots)
    standings = events.live_standings(event)
    winner = _winner(event)
    runs = without_withdrawn(shown_runs(event))
    duels = duels_of(event.race) if event.race.opponents == Opponents.MODELS else None
    lobby = [] if event.begun_at is not None else events.live_racers(event)
    return {
        "race": event.race.slug,
        "name": event.race.name,
        "phase": events.phase_of(event, now),
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
        "current": None if playing is None else slot_document(playing, now, on_track=True),
        "next": [slot_document(slot, now) for slot in events.up_next(event, slots)],
        "order": [slot_document(slot, now) for slot in slots],
        "racers": [{**_racer(racer), "here": racer.here_at is not None} for racer in lobby],
        "standings": [row_document(row) for row in standings],
        "bracket": [] if duels is None else [_round(one) for one in duels.rounds],
        "winner": None if winner is None else winner.racer.alias,
        "podium": [entry.racer.alias for entry in podium_entries(event, standings)],
        "best_sectors": best_sectors(runs),
        "own_sectors": best_sectors_by_racer(runs),
        "leader": leader_document(event, runs),
        "reactions": events.reactions_of(event),
    }


def slot_document(slot: LiveSlot, now: datetime, *, on_track: bool = False) -> LiveSlotDocument:
    """A place in the running order, without the run's end: that would give away a coming failure. ``on_track``: with
    the looks of its cars."""
    run = slot.shown_run
    looks = _looks(slot) if on_track else {}
    heat: LiveRacerDocument = {"racer": slot.driver_names, "country": "", "qualified_rank": None}
    return {
        **(heat if slot.racer is None else _racer(slot.racer)),
        "slot": slot.pk,
        "round": slot.round,
        "attempt": slot.attempt,
        "state": slot.phase_at(now),
        "starts_at": None if slot.starts_at is None else milliseconds(slot.starts_at),
        "evaluation": None if run is None else run.public_id,
        "reason": slot.reason_code,
        "speed": present_speed(slot, now),
        "heat": None if slot.duel is None else slot.duel.number,
        "cars": [
            {
                "number": number,
                "racer": entry.racer.alias,
                "country": str(entry.racer.country or ""),
                "look": looks.get(number),
                "speed": present_speed(slot, now, number),
            }
            for number, entry in enumerate(slot.starting)
        ],
    }


def _looks(slot: LiveSlot) -> dict[int, dict[str, str]]:
    """The looks of the cars of a run, by their numbers."""
    run = Evaluation.with_sealed.select_related("model__owner").filter(pk=slot.evaluation_id or 0).first()
    return {} if run is None else {car.number: look_document(car.look) for car in live_cars(run)}


def _round(of: DuelRound) -> LiveRoundDocument:
    """A round as shown so far: ties of a bracket (None for open places) or heats of a round robin."""
    ties: list[LiveTieDocument] = [
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
    heats: list[LiveHeatDocument] = [
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


def _racer(racer: LiveRacer) -> LiveRacerDocument:
    of = racer.entry.racer
    return {"racer": of.alias, "country": str(of.country or ""), "qualified_rank": racer.qualified_rank}


def row_document(row: events.LiveRow) -> LiveStandingDocument:
    standing: Standing | None = row.standing
    return {
        **_racer(row.racer),
        "rank": row.rank,
        "attempts": row.attempts,
        "score_ms": None if standing is None else standing.score_ms,
        "gap_ms": row.gap_ms,
        "points": row.points,
        "best_lap_ms": None if standing is None else standing.best_lap_ms,
        "complete_laps": None if standing is None else standing.complete_laps,
        "sectors": [] if standing is None else list(standing.sectors),
    }


def leader_document(event: LiveEvent, runs: Iterable[DrivenRun]) -> LiveLeaderDocument | None:
    """The leading run of these; None before the first that is classified."""
    leader = leader_of(runs)
    if leader is None or leader.standing is None:
        return None
    return {
        "racer": leader.alias,
        "slot": leader.slot.pk,
        "whole": event.race.counts_all_laps,
        "lap": leader.standing.best_lap_number,
        "sectors": list(leader.standing.sectors),
    }


def _winner(event: LiveEvent) -> Entry | None:
    """The winner, unless withdrawn."""
    return None if event.winner is None or event.winner.is_withdrawn else event.winner


def podium_entries(event: LiveEvent, standings: list[events.LiveRow]) -> list[Entry]:
    """The entries on the podium, the winner first; empty until it is shown, and of duels that were ended before their
    last."""
    winner = _winner(event)
    if (
        event.podium_at is None
        or event.state == LiveState.CANCELLED
        or (winner is None and events.duels_are_open(event.race))
    ):
        return []
    placed = [row.racer.entry for row in standings if row.rank is not None]
    if winner is not None:
        placed = [winner, *(entry for entry in placed if entry.pk != winner.pk)]
    return placed[: events.PODIUM]
