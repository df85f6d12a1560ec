"""Duels in a live event: their heats are places in its running order, computed sealed and decided when they were shown.

Until then a heat waits like one that nobody has driven: only its slot knows the run. So bracket, points and the next
round's pairs, which are read from decided heats, tell nothing.
"""

from __future__ import annotations

from datetime import datetime

from django.db.models import Count, Max

from evaluation.models import Evaluation, State, TrainedModel
from evaluation.queue_order import URGENT
from evaluation.selectors import can_use_model
from evaluation.services import queue_evaluation
from paddock.errors import UserFault

from ...live_rules import live_rules
from ...models import (
    Duel,
    DuelCompetitor,
    DuelState,
    LiveEvent,
    LiveRacer,
    LiveSlot,
    Opponents,
    SlotState,
)
from ...speed_log import rules_with, start_log
from ..duels import MAX_TRIES, counted_run, draw_duels, drive_on, starting_cars, walk_over
from .roll import throw_away


def begin_heats(event: LiveEvent, now: datetime) -> None:
    """Draw the duels, unless they are, and write the first heats into the running order. The caller holds the event.

    Raises UserFault as ``draw_duels``, ``live_nobody`` where fewer than two cars were drawn.
    """
    draw_duels(race=event.race, now=now)
    arrange_heats(event, now)
    if not LiveSlot.objects.filter(event=event).exists():
        raise UserFault("live_nobody")


def arrange_heats(event: LiveEvent, now: datetime) -> None:
    """Put the heats that are known by what was shown into the running order, and decide those that need no run because
    a racer has left. What is in it already stays. The caller holds the event."""
    if event.race.opponents != Opponents.MODELS:
        return
    _drop_outdated(event, now)
    while True:
        drive_on(race=event.race, now=now)
        _write_slots(event)
        if not _walk_overs(event, now):
            return


def seal_heat(event: LiveEvent, slot: LiveSlot, now: datetime) -> bool:
    """Queue the sealed run of a heat. False when it cannot be driven; the slot's ``reason_code`` says why."""
    assert slot.duel is not None
    starting = starting_cars(slot.duel)
    front, *others = (_model_of(event, car) for car in starting)
    racers = {one.entry_id: one for one in LiveRacer.objects.filter(event=event)}
    log = start_log(event, [racers.get(car.entry_id) for car in starting])
    try:
        evaluation = queue_evaluation(
            owner=front.owner,
            model=front,
            track=event.race.track,
            rules=rules_with(live_rules(event), log),
            rivals=others,
            priority=URGENT,
            sealed=True,
            now=now,
        )
    except UserFault as fault:
        LiveSlot.objects.filter(pk=slot.pk).update(reason_code=fault.code)
        return False
    LiveSlot.objects.filter(pk=slot.pk).update(evaluation=evaluation, reason_code="", speed_log=log)
    return True


def hand_heat_over(slot: LiveSlot, evaluation: Evaluation) -> None:
    """Let a run that was shown be its heat's: the end of it, told when it is unsealed, decides the heat. One without a
    result is void, for it was shown as that."""
    assert slot.duel_id is not None, "a heat's slot"
    tries = 1 if evaluation.state == State.FINISHED else MAX_TRIES
    waiting = Duel.objects.filter(pk=slot.duel_id, state=DuelState.WAITING)
    waiting.update(state=DuelState.DRIVING, evaluation=evaluation, tries=tries)


def _write_slots(event: LiveEvent) -> None:
    """A place for each heat that waits and has none. One that was shown and waits again gets one more."""
    slots = LiveSlot.objects.filter(event=event, duel__isnull=False)
    placed = set(slots.exclude(state=SlotState.DONE).values_list("duel", flat=True))
    shown = dict(slots.order_by().values_list("duel").annotate(Count("pk")))
    last = LiveSlot.objects.filter(event=event).aggregate(at=Max("position"))["at"] or 0
    absent = set()
    if event.roll_call:
        absent = set(LiveRacer.objects.filter(event=event, here_at=None).values_list("entry", flat=True))
    waiting = Duel.objects.filter(race=event.race, state=DuelState.WAITING).exclude(pk__in=placed)
    new = []
    for position, duel in enumerate(waiting.order_by("round", "number").prefetch_related("cars"), start=last + 1):
        held = any(car.entry_id in absent for car in duel.cars.all())
        new.append(
            LiveSlot(
                event=event,
                duel=duel,
                round=duel.round,
                attempt=shown.get(duel.pk, 0) + 1,
                position=position,
                state=SlotState.HELD if held else SlotState.WAITING,
                reason_code="live_absent" if held else "",
            )
        )
    LiveSlot.objects.bulk_create(new)


def _walk_overs(event: LiveEvent, now: datetime) -> int:
    """Decide the heats of which fewer than two cars are left. Returns how many."""
    found = 0
    for slot in _undriven(event):
        duel = slot.duel
        assert duel is not None
        if sum(not car.entry.is_withdrawn for car in duel.cars.all()) >= 2:
            continue
        starting_cars(duel)
        walk_over(race=event.race, duel=duel, now=now)
        LiveSlot.objects.filter(pk=slot.pk).update(state=SlotState.DONE, done_at=now, reason_code="live_walkover")
        found += 1
    return found


def _drop_outdated(event: LiveEvent, now: datetime) -> None:
    """Throw away what was computed with a car whose racer has left since."""
    for slot in _undriven(event):
        assert slot.duel is not None
        changed = any(car.forfeited != car.entry.is_withdrawn for car in slot.duel.cars.all())
        if changed and slot.evaluation is not None:
            throw_away(slot, slot.evaluation, now)


def _undriven(event: LiveEvent) -> list[LiveSlot]:
    """The places of heats that wait, held and skipped ones too."""
    slots = LiveSlot.objects.filter(event=event, duel__state=DuelState.WAITING)
    slots = slots.exclude(state__in=(SlotState.RUNNING, SlotState.DONE)).select_related("duel", "evaluation")
    return list(slots.prefetch_related("duel__cars__entry"))


def _model_of(event: LiveEvent, car: DuelCompetitor) -> TrainedModel:
    """What a car of a heat is: the one that its racer chose for the event, else the one that it was drawn by."""
    racer = LiveRacer.objects.filter(event=event, entry=car.entry).select_related("model__owner").first()
    chosen = None if racer is None else racer.model
    if chosen is not None and can_use_model(car.entry.racer, chosen):
        return chosen
    return counted_run(car.entry).evaluation.model
