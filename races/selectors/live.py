"""Live events as pages and the API show them: who may see them, how they stand, what is played now.

Nothing here reads a sealed run but :func:`played`, which hands out what has passed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from django.db.models import QuerySet

from evaluation.models import FINAL_STATES, Evaluation, Result, State

from ..models import (
    HEAT_CARS,
    Draw,
    Duel,
    Entry,
    LiveEvent,
    LiveRacer,
    LiveSlot,
    LiveState,
    Opponents,
    Race,
    SlotState,
)
from ..models.live import OVER, TO_COME, UNDO_FOR
from ..poses import Chunk, chunks_of, line_of, passed
from ..ranking import Standing, standing_in
from .boards import ORDER
from .visibility import can_organise, can_see_race, races_visible_to

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

UP_NEXT = 3
SOON = timedelta(hours=24)
TOLD_OF = 3  # live events on a page of many races
PODIUM = 3
MOST_CHUNKS = 120  # a minute in one answer


@dataclass(frozen=True)
class LiveRow:
    """A racer in the standings of a live event. ``standing``: of their best attempt that was shown, None before the
    first; ``attempts``: how many were. ``gap_ms``: to the leader's score. ``points``: in duels."""

    racer: LiveRacer
    rank: int | None
    standing: Standing | None
    attempts: int
    gap_ms: int | None
    points: int | None = None


@dataclass(frozen=True)
class SlotRow:
    """A place in the running order for its organisers. ``sealed``: ``"sealed"`` once its run is computed,
    ``"computing"`` until then, ``""`` where none is asked for or it was shown. How the run ended is told to nobody."""

    slot: LiveSlot
    phase: str
    sealed: str
    may: frozenset[str]


def can_see_live(racer: Racer | AnonymousUser | None, event: LiveEvent) -> bool:
    """Whether the racer may see a live event: who may see its race. Twin of :func:`live_events_visible_to`."""
    return can_see_race(racer, event.race)


def live_events_visible_to(racer: Racer | AnonymousUser | None) -> QuerySet[LiveEvent]:
    """All live events that the racer may see. Twin of :func:`can_see_live`."""
    races = races_visible_to(racer).order_by().values("pk")
    return LiveEvent.objects.filter(race__in=races).select_related("race__track", "race__organiser", "winner__racer")


def can_run_live(racer: Racer | AnonymousUser | None, event: LiveEvent) -> bool:
    """Whether the racer may act in the event's console: who organises its race."""
    return can_organise(racer, event.race)


def live_events_run_by(racer: Racer | AnonymousUser | None) -> QuerySet[LiveEvent]:
    """All live events that the racer may run. Twin of :func:`can_run_live`."""
    events = live_events_visible_to(racer)
    if racer is None or not racer.is_authenticated:
        return events.none()
    return events if racer.is_staff else events.filter(race__organiser_id=racer.pk)


def live_to_come(racer: Racer | AnonymousUser | None, now: datetime, *, within: timedelta) -> QuerySet[LiveEvent]:
    """What is live now or begins soon, as far as the racer may see it, the first first."""
    events = live_events_visible_to(racer).exclude(state__in=OVER).filter(race__cancelled_at=None)
    return events.filter(starts_at__lte=now + within).order_by("starts_at", "pk")


@dataclass(frozen=True)
class LiveNow:
    """A live event as pages of other things tell of it. ``current``: who drives now; ``next``: who comes then."""

    event: LiveEvent
    phase: str
    current: LiveSlot | None
    next: list[LiveSlot]


def live_now(racer: Racer | AnonymousUser | None, now: datetime, races: Iterable[int] | None = None) -> list[LiveNow]:
    """What is live now or within a day: the first few, as far as the racer may see them. ``races``: ids of the only
    races that are asked for. One query where there is none."""
    events = live_to_come(racer, now, within=SOON)
    if races is not None:
        events = events.filter(race__in=list(races))
    found = []
    for event in events[:TOLD_OF]:
        slots = running_order(event) if event.begun_at is not None else []
        found.append(LiveNow(event, phase_of(event, now), on_track(slots), up_next(event, slots)))
    return found


def phase_of(event: LiveEvent, now: datetime) -> str:
    """The state of an event, or ``"lobby"`` between the opening of the lobby and the beginning."""
    if event.race.cancelled_at is not None:
        return str(LiveState.CANCELLED)
    return "lobby" if event.in_lobby(now) else str(event.state)


def live_racers(event: LiveEvent) -> list[LiveRacer]:
    """Who takes part: who chose a model, said that they are here, or is in the running order, and has not left."""
    racers = LiveRacer.objects.filter(event=event, entry__withdrawn_at=None).select_related(
        "entry__racer", "model__owner"
    )
    return list(racers.order_by("entry__entered_at", "entry__pk"))


def running_order(event: LiveEvent) -> list[LiveSlot]:
    """Every place in the running order, in order."""
    related = ("racer__entry__racer", "racer__model", "submission__evaluation", "duel__evaluation")
    slots = LiveSlot.objects.filter(event=event).select_related(*related).prefetch_related(HEAT_CARS)
    return list(slots.order_by("position", "pk"))


def on_track(slots: Sequence[LiveSlot]) -> LiveSlot | None:
    """The slot that counts down or is played."""
    return next((slot for slot in slots if slot.state == SlotState.RUNNING), None)


def up_next(event: LiveEvent, slots: Sequence[LiveSlot]) -> list[LiveSlot]:
    """Who comes next of the running order, who was called first; nobody once the event is over."""
    if event.is_over:
        return []
    coming = [slot for slot in slots if slot.state in TO_COME]
    return sorted(coming, key=lambda slot: (slot.state != SlotState.CALLED, slot.position, slot.pk))[:UP_NEXT]


def live_standings(event: LiveEvent) -> list[LiveRow]:
    """How the event stands by the runs that were shown, the first first; then who has no rank yet. Who has left stands
    nowhere."""
    race = event.race
    if race.opponents == Opponents.MODELS:
        return _drawn_standings(event)
    slots = LiveSlot.objects.filter(event=event, racer__entry__withdrawn_at=None, racer__isnull=False)
    slots = slots.exclude(state=SlotState.REMOVED).select_related("racer__entry__racer").order_by("position", "pk")
    shown = [slot for slot in slots if slot.state == SlotState.DONE]
    laps = _laps_of(shown)
    racers: dict[int, LiveRacer] = {}
    for slot in slots:
        assert slot.racer is not None
        racers.setdefault(slot.racer.pk, slot.racer)
    driven = []
    for slot in shown:
        assert slot.racer is not None
        has_result = slot.evaluation_id in laps
        driven.append((slot.racer.entry_id, standing_in(race, laps[slot.evaluation_id]) if has_result else None))
    return rows_by_time(list(racers.values()), driven)


def rows_by_time(racers: Sequence[LiveRacer], driven: Iterable[tuple[int, Standing | None]]) -> list[LiveRow]:
    """The racers by the best of their attempts, the first first; then, as they come, who has none. ``driven``: of each
    attempt the entry, and what it is worth."""
    best: dict[int, Standing] = {}
    attempts: Counter[int] = Counter()
    for entry, standing in driven:
        attempts[entry] += 1
        if standing is not None:
            held = best.get(entry)
            best[entry] = standing if held is None or standing.key < held.key else held
    ranked = sorted((racer for racer in racers if racer.entry_id in best), key=lambda racer: best[racer.entry_id].key)
    leader = best[ranked[0].entry_id].score_ms if ranked else None
    rows = []
    for place, racer in enumerate(ranked, start=1):
        standing = best[racer.entry_id]
        gap = None if standing.score_ms is None or leader is None else standing.score_ms - leader
        rank = place if standing.classified else None
        rows.append(LiveRow(racer, rank, standing, attempts[racer.entry_id], gap))
    others = [racer for racer in racers if racer.entry_id not in best]
    return rows + [LiveRow(racer, None, None, attempts[racer.entry_id], None) for racer in others]


def _drawn_standings(event: LiveEvent) -> list[LiveRow]:
    """How the duels stand by the heats that were shown: nobody has a rank before the first."""
    entries = Entry.objects.filter(race=event.race, seed__isnull=False, withdrawn_at=None).order_by(*ORDER)
    racers = {racer.entry_id: racer for racer in live_racers(event)}
    decided = Duel.objects.filter(race=event.race, decided_at__isnull=False).exists()
    return [
        LiveRow(racers[entry.pk], place if decided else None, None, entry.duels, None, entry.points)
        for place, entry in enumerate(entries, start=1)
        if entry.pk in racers
    ]


def duels_are_open(race: Race) -> bool:
    """Whether a race's duels have no winner yet. False for a race of another kind."""
    return race.opponents == Opponents.MODELS and not Draw.objects.filter(race=race, over_at__isnull=False).exists()


def is_driven_live(race: Race, now: datetime) -> bool:
    """Whether a race's heats are its live event's to drive: until it is over, and its end can no longer be undone."""
    return LiveEvent.objects.filter(race=race).exclude(state__in=OVER, last_at__lt=now - UNDO_FOR).exists()


def _laps_of(slots: Sequence[LiveSlot]) -> dict[int | None, Any]:
    """The laps of runs that were shown, by their evaluation."""
    results = Result.objects.filter(evaluation__in=[slot.evaluation_id for slot in slots])
    return dict(results.values_list("evaluation", "laps"))


def console_rows(event: LiveEvent, now: datetime) -> list[SlotRow]:
    """The running order with what may be done to each place."""
    slots = running_order(event)
    wanted = [slot.evaluation_id for slot in slots if slot.evaluation_id is not None]
    final = set(Evaluation.with_sealed.filter(pk__in=wanted, state__in=FINAL_STATES).values_list("pk", flat=True))
    busy = any(slot.state == SlotState.RUNNING for slot in slots)
    return [_console_row(event, slot, slot.evaluation_id in final, busy, now) for slot in slots]


def _console_row(event: LiveEvent, slot: LiveSlot, computed: bool, busy: bool, now: datetime) -> SlotRow:
    sealed = ""
    if slot.evaluation_id is not None and slot.state in (*TO_COME, SlotState.HELD, SlotState.SKIPPED):
        sealed = "sealed" if computed else "computing"
    may: set[str] = set()
    if event.state in (LiveState.RUNNING, LiveState.PAUSED):
        if slot.state == SlotState.WAITING:
            may |= {"call"}
        if slot.state in TO_COME:
            may |= {"skip", "hold", "remove", "move"}
            if event.state == LiveState.RUNNING and sealed == "sealed" and not busy:
                may |= {"launch"}
        if slot.state == SlotState.HELD:
            may |= {"release", "skip", "remove", "move"}
        if slot.state in (SlotState.SKIPPED, SlotState.REMOVED) and slot.reason_code != "live_left":
            may |= {"release"}
        if slot.state in (SlotState.DONE, SlotState.SKIPPED):
            may |= {"again"}
        if slot.duel_id is not None:
            may -= {"remove", "again"} if slot.state != SlotState.SKIPPED else {"remove"}
    return SlotRow(slot, slot.phase_at(now), sealed, frozenset(may))


def played(slot: LiveSlot, now: datetime, *, after: int = -1) -> tuple[list[Chunk], bool]:
    """The chunks of a run whose time has come, from the one after number ``after`` on, :data:`MOST_CHUNKS` at most;
    and whether these are the last there are. Of a run that was not launched there are none.

    This is the only way by which something of a sealed run leaves the server.
    """
    if slot.state not in (SlotState.RUNNING, SlotState.DONE) or slot.starts_at is None or slot.evaluation_id is None:
        return [], False
    result = Result.with_sealed.filter(evaluation=slot.evaluation_id).defer("trajectory", "metrics").first()
    if result is None:
        return [], slot.state == SlotState.DONE
    first = max(0, after + 1)
    until = passed(slot.starts_at, now)
    if slot.state != SlotState.DONE and until <= first:
        return [], False
    chunks = chunks_of(result)
    shown = chunks if slot.state == SlotState.DONE else chunks[:until]
    some = list(shown[first : first + MOST_CHUNKS])
    return some, slot.state == SlotState.DONE and first + len(some) >= len(chunks)


def shown_line(slot: LiveSlot, now: datetime, lap: int | None) -> dict[str, Any] | None:
    """The line of a run that was shown to its end, or of one of its laps (:func:`races.poses.line_of`), to be driven
    beside; None for a run that was not, and for a lap that it has not completed."""
    if slot.state != SlotState.DONE:
        return None
    chunks: list[Chunk] = []
    while some := played(slot, now, after=chunks[-1]["n"] if chunks else -1)[0]:
        chunks += some
    line = line_of(chunks, lap)
    return line if line["t"] else None


def has_failed(slot: LiveSlot) -> bool:
    """Whether a run that was shown had no result, by its car's fault."""
    submission = slot.submission
    return slot.state == SlotState.DONE and submission is not None and submission.evaluation.state == State.FAILED


def pending_live(race: Race) -> bool:
    """Whether a race's live event is still to come or under way, so that its board is not final."""
    return LiveEvent.objects.filter(race=race).exclude(state__in=OVER).exists()
