"""Live events for pages and the API: permissions, standings and the run on track.

Only :func:`played` reads a sealed run, and it returns no more than what has passed.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from django.db.models import Expression, QuerySet

from accounts.models import Viewer
from core.database.kept_queries import KeptQuery
from core.streams.shared_pieces import shared_value
from evaluation.models import FINAL_STATES, Evaluation, Result

from ...boards.ranking import Lap, Standing, standing_in
from ...boards.selectors.board import ORDER
from ...entries.selectors.visibility import can_organise, can_see_race, races_visible_to
from ...models import (
    HEAT_CARS,
    Draw,
    Duel,
    Entry,
    LiveEvent,
    LiveRacer,
    LiveReaction,
    LiveSlot,
    LiveState,
    Opponents,
    Race,
    ReactionKind,
    SlotState,
)
from ...models.live import OVER, TO_COME, UNDER_WAY
from ..streaming.pose_chunks import ChunkDocument, chunks_of, line_of, passed

LIVE_RELATED = ("race__track", "race__organiser", "winner__racer")
UP_NEXT = 3
SOON = timedelta(hours=24)
MAX_SHOWN = 3  # live events on a page of many races
PODIUM = 3
REACTIONS_AFTER = timedelta(minutes=10)  # a podium is applauded
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
    ``"computing"`` until then, ``""`` for a run that was not requested or was shown. It has no outcome of the run."""

    slot: LiveSlot
    phase: str
    sealed: str
    may: frozenset[str]


def can_see_live(racer: Viewer, event: LiveEvent) -> bool:
    """Whether the racer may see a live event, as its race. Keep in step with :func:`live_events_visible_to`."""
    return can_see_race(racer, event.race)


def live_events_visible_to(racer: Viewer) -> QuerySet[LiveEvent]:
    """All live events that the racer may see. Keep in step with :func:`can_see_live`."""
    races = races_visible_to(racer).order_by().values("pk")
    return LiveEvent.objects.filter(race__in=races).select_related(*LIVE_RELATED)


def can_run_live(racer: Viewer, event: LiveEvent) -> bool:
    """Whether the racer may use the event's console, as an organiser of its race."""
    return can_organise(racer, event.race)


@dataclass(frozen=True)
class LiveNow:
    """A live event for other pages. ``current``: the slot on track; ``next``: those after it."""

    event: LiveEvent
    phase: str
    current: LiveSlot | None
    next: list[LiveSlot]


def live_now(racer: Viewer, now: datetime, races: Iterable[int] | None = None) -> list[LiveNow]:
    """The first :data:`MAX_SHOWN` live events now or within a day that the racer may see. ``races``: restricts them to
    races with these ids. One query where there is none."""
    return _live_now(_soon(live_events_visible_to(racer), now, races), now)


def live_for_all(now: datetime, races: Iterable[int] | None = None) -> list[LiveNow]:
    """The same whoever may see them."""
    return _live_now(_soon(LiveEvent.objects.select_related(*LIVE_RELATED), now, races), now)


def live_of_race(race: int, now: datetime) -> list[LiveNow]:
    """:func:`live_for_all` in one race."""
    return _live_now(_soon_in_race(race=race, until=now + SOON), now)


def _soon(events: QuerySet[LiveEvent], now: datetime, races: Iterable[int] | None) -> QuerySet[LiveEvent]:
    if races is not None:
        events = events.filter(race__in=list(races))
    return _until(events, now + SOON)


def _until(events: QuerySet[LiveEvent], last: datetime | Expression) -> QuerySet[LiveEvent]:
    events = events.exclude(state__in=OVER).filter(race__cancelled_at=None)
    return events.filter(starts_at__lte=last).order_by("starts_at", "pk")[:MAX_SHOWN]


_soon_in_race = KeptQuery(
    lambda race, until: _until(LiveEvent.objects.select_related(*LIVE_RELATED).filter(race=race), until)
)


def _live_now(events: Iterable[LiveEvent], now: datetime) -> list[LiveNow]:
    shown = list(events)
    if not shown:
        return []
    orders: dict[int, list[LiveSlot]] = {event.pk: [] for event in shown}
    for slot in _slots_in_order().filter(event__in=[event for event in shown if event.begun_at is not None]):
        orders[slot.event_id].append(slot)
    return [
        LiveNow(event, phase_of(event, now), on_track(orders[event.pk]), up_next(event, orders[event.pk]))
        for event in shown
    ]


def phase_of(event: LiveEvent, now: datetime) -> str:
    """The state of an event, or ``"lobby"`` between the opening of the lobby and the beginning."""
    if event.race.cancelled_at is not None:
        return str(LiveState.CANCELLED)
    return "lobby" if event.in_lobby(now) else str(event.state)


def live_racers(event: LiveEvent) -> list[LiveRacer]:
    """The participants: racers who chose a model, checked in or are in the running order, and have not left."""
    racers = LiveRacer.objects.filter(event=event, entry__withdrawn_at=None).select_related(
        "entry__racer", "model__owner"
    )
    return list(racers.order_by("entry__entered_at", "entry__pk"))


def running_order(event: LiveEvent) -> list[LiveSlot]:
    """Every place in the running order, in order."""
    return list(_slots_in_order().filter(event=event))


def _slots_in_order() -> QuerySet[LiveSlot]:
    related = ("racer__entry__racer", "racer__model", "submission__evaluation", "duel__evaluation")
    slots = LiveSlot.objects.select_related(*related).prefetch_related(HEAT_CARS)
    return slots.order_by("position", "pk")


def on_track(slots: Sequence[LiveSlot]) -> LiveSlot | None:
    """The slot that counts down or is played."""
    return next((slot for slot in slots if slot.state == SlotState.RUNNING), None)


def up_next(event: LiveEvent, slots: Sequence[LiveSlot]) -> list[LiveSlot]:
    """The next slots of the running order, called ones first; none once the event is over."""
    if event.is_over:
        return []
    coming = [slot for slot in slots if slot.state in TO_COME]
    return sorted(coming, key=lambda slot: (slot.state != SlotState.CALLED, slot.position, slot.pk))[:UP_NEXT]


def live_standings(event: LiveEvent) -> list[LiveRow]:
    """The standings from the shown runs, best first, then racers without a rank. Racers who left are not listed."""
    race = event.race
    if race.opponents == Opponents.MODELS:
        return _drawn_standings(event)
    slots = LiveSlot.objects.filter(event=event, racer__entry__withdrawn_at=None, racer__isnull=False)
    slots = slots.exclude(state=SlotState.REMOVED).select_related("racer__entry__racer").order_by("position", "pk")
    shown = [slot for slot in slots if slot.state == SlotState.DONE]
    results = Result.objects.filter(evaluation__in=[slot.evaluation_id for slot in shown])
    laps: dict[int | None, list[Lap]] = dict(results.values_list("evaluation", "laps"))
    driven = [
        (slot.racer.entry_id, standing_in(race, laps[slot.evaluation_id]) if slot.evaluation_id in laps else None)
        for slot in shown
        if slot.racer is not None
    ]
    racers = {slot.racer.pk: slot.racer for slot in slots if slot.racer is not None}
    return rows_by_time(list(racers.values()), driven)


@dataclass(frozen=True)
class LiveRows:
    """What every reader of a live event sees alike, for reading only."""

    order: list[LiveSlot]
    standings: list[LiveRow]
    racers: list[LiveRacer]


def shared_rows(event: LiveEvent) -> LiveRows:
    """The running order, standings and participants, read once a second for all readers."""

    def read() -> LiveRows:
        return LiveRows(running_order(event), live_standings(event), live_racers(event))

    return shared_value(("live rows", event.pk, event.version), read)


def rows_by_time(racers: Sequence[LiveRacer], driven: Iterable[tuple[int, Standing | None]]) -> list[LiveRow]:
    """The racers by their best attempts, then those without one. ``driven``: the entry and result of each attempt."""
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
    """The duels' standings from the shown heats, without ranks before the first."""
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


# What organisers may do to a place in the running order while the event is under way, by its state.
_MAY: dict[str, tuple[str, ...]] = {
    SlotState.WAITING: ("call", "skip", "hold", "remove", "move"),
    SlotState.CALLED: ("skip", "hold", "remove", "move"),
    SlotState.HELD: ("release", "skip", "remove", "move"),
    SlotState.SKIPPED: ("release", "again"),
    SlotState.REMOVED: ("release",),
    SlotState.DONE: ("again",),
}


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
    may = set(_MAY.get(slot.state, ())) if event.state in UNDER_WAY else set()
    if event.state == LiveState.RUNNING and slot.state in TO_COME and sealed == "sealed" and not busy:
        may.add("launch")
    if slot.reason_code == "live_left":
        may.discard("release")
    if slot.duel_id is not None:
        may -= {"remove"} if slot.state == SlotState.SKIPPED else {"remove", "again"}
    return SlotRow(slot, slot.phase_at(now), sealed, frozenset(may))


def played(slot: LiveSlot, now: datetime, *, after: int = -1) -> tuple[list[ChunkDocument], bool]:
    """The chunks of a run whose time has come, from the one after number ``after`` on, :data:`MOST_CHUNKS` at most; and
    whether these are the last there are. Of a run that was not launched there are none. This is the only way by which
    something of a sealed run leaves the server."""
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


def shown_line(slot: LiveSlot, now: datetime, lap: int | None) -> dict[str, list[Any]] | None:
    """The columns of a fully shown run or of one of its laps, for a ghost; None for other runs and incomplete laps. See
    :func:`races.live.streaming.pose_chunks.line_of`."""
    if slot.state != SlotState.DONE:
        return None
    line = line_of(list(all_played(slot, now)), lap)
    return line if line["t"] else None


def all_played(slot: LiveSlot, now: datetime) -> Iterator[ChunkDocument]:
    """Every chunk of a run whose time has come."""
    after = -1
    while chunks := played(slot, now, after=after)[0]:
        yield from chunks
        after = chunks[-1]["n"]


def pending_live(race: Race) -> bool:
    """Whether a race's live event is still to come or under way, so that its board is not final."""
    return LiveEvent.objects.filter(race=race).exclude(state__in=OVER).exists()


def reactions_of(event: LiveEvent) -> dict[str, int]:
    """The count of each kind of reaction, including zeros."""
    sent = dict(LiveReaction.objects.filter(event=event).values_list("kind", "count"))
    return {kind.value: sent.get(kind.value, 0) for kind in ReactionKind}


def takes_reactions(event: LiveEvent, now: datetime) -> bool:
    """Whether spectators react now: from the lobby until ten minutes after the end."""
    if event.race.cancelled_at is not None:
        return False
    if event.state == LiveState.ENDED:
        return event.ended_at is not None and now < event.ended_at + REACTIONS_AFTER
    return event.state in UNDER_WAY or event.in_lobby(now)
