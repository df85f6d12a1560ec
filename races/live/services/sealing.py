"""Computing the next runs of a live event ahead; they stay sealed until they were played.

Until then a heat of duels looks undriven: only its slot refers to the run. So the bracket, the points and the next
round's pairs, which are read from decided heats, reveal nothing.
"""

import logging
from datetime import datetime
from typing import Any

from django.db import transaction
from django.db.models import Count, Max

from core.database.after_commit import after_commit
from evaluation.models import Evaluation, State, TrainedModel
from evaluation.running.queue.order import URGENT
from evaluation.running.queue.services import queue_evaluation
from evaluation.selectors import can_use_model
from paddock.errors import UserFault

from ...duels.services import MAX_TRIES, counted_run, drive_on, starting_cars, walk_over
from ...models import (
    HEAT_CARS,
    Duel,
    DuelCompetitor,
    DuelState,
    Entry,
    LiveEvent,
    LiveRacer,
    LiveSlot,
    Opponents,
    SlotState,
)
from ...models.live import TO_COME, UNDER_WAY
from ...rules.live_start import attempt_rules, live_rules
from ..selectors.speed import StoredCommand, rules_with, start_log
from .roll_call import lacks_car, model_of, take_out_left, throw_away

logger = logging.getLogger(__name__)
AHEAD = 2


@transaction.atomic
def prepare_ahead(*, event: LiveEvent, now: datetime) -> int:
    """Queue the missing sealed runs of the next slots, ahead of all other jobs. Returns their number. It skips slots
    without a model and stores the reason in ``reason_code``."""
    event = LiveEvent.objects.select_for_update(of=("self",)).select_related("race__track").get(pk=event.pk)
    if event.state not in UNDER_WAY:
        return 0
    take_out_left(event, now)
    arrange_heats(event, now)
    queued = ahead = 0
    for slot in next_slots(event):
        if ahead == AHEAD:
            break
        ahead += 1
        if slot.evaluation_id is not None:
            continue
        if slot.racer is None:
            queued += seal_heat(event, slot, now)
            continue
        model = model_of(slot.racer)
        if model is None:
            LiveSlot.objects.filter(pk=slot.pk).update(reason_code=lacks_car(slot.racer))
            ahead -= 1  # it is passed over
            continue
        log = start_log(event, [slot.racer])
        rules = rules_with(attempt_rules(event), log)
        queued += queue_sealed(event, slot, log, owner=slot.racer.entry.racer, model=model, rules=rules, now=now)
    return queued


def next_slots(event: LiveEvent) -> list[LiveSlot]:
    """The slots to come, in running order, called ones first."""
    related = (
        "racer__entry__racer",
        "racer__entry__best__evaluation__model__owner",
        "racer__model__owner",
        "evaluation",
    )
    slots = LiveSlot.objects.filter(event=event, state__in=TO_COME).select_related(*related)
    slots = slots.prefetch_related(HEAT_CARS)
    return sorted(slots, key=lambda slot: (slot.state != SlotState.CALLED, slot.position, slot.pk))


def prepare_after_commit(event: LiveEvent, now: datetime) -> None:
    """:func:`prepare_ahead` once the present transaction is through. If it fails, the clock does it again."""
    after_commit(_prepare_safely, event, now)


def _prepare_safely(event: LiveEvent, now: datetime) -> None:
    try:
        prepare_ahead(event=event, now=now)
    except Exception:  # what was done stands; the clock tries again
        logger.exception("The next runs of the live event of %s cannot be computed ahead.", event.race_id)


@transaction.atomic
def tidy_ended(*, event: LiveEvent, now: datetime) -> int:
    """Discard the sealed runs of an event that is over for good. Returns how many."""
    event = LiveEvent.objects.select_for_update().get(pk=event.pk)
    thrown = 0
    slots = LiveSlot.objects.filter(event=event, evaluation__sealed=True).exclude(state=SlotState.RUNNING)
    for slot in slots.select_related("evaluation"):
        if slot.evaluation is not None and event.is_over:
            throw_away(slot, slot.evaluation, now)
            thrown += 1
    return thrown


def take_out_departed(entry: Entry, now: datetime) -> None:
    """Remove the coming runs of an entry that left its race from the running order. If it fails, the clock does it."""
    for event in LiveEvent.objects.filter(race=entry.race_id, state__in=UNDER_WAY):
        prepare_ahead(event=event, now=now)


def arrange_heats(event: LiveEvent, now: datetime) -> None:
    """Add the heats known from shown runs to the running order, and decide heats without a run after a racer left.
    Existing places stay. The caller holds the event."""
    if event.race.opponents != Opponents.MODELS:
        return
    _drop_outdated(event, now)
    while True:
        drive_on(race=event.race, now=now)
        _write_slots(event)
        if not _walk_overs(event, now):
            return


def seal_heat(event: LiveEvent, slot: LiveSlot, now: datetime) -> bool:
    """Queue the sealed run of a heat. False when it cannot be driven; the slot's ``reason_code`` is the cause."""
    assert slot.duel is not None
    starting = starting_cars(slot.duel)
    front, *others = (_model_of(event, car) for car in starting)
    racers = {one.entry_id: one for one in LiveRacer.objects.filter(event=event)}
    log = start_log(event, [racers.get(car.entry_id) for car in starting])
    rules = rules_with(live_rules(event), log)
    return queue_sealed(event, slot, log, owner=front.owner, model=front, rules=rules, rivals=others, now=now)


def queue_sealed(event: LiveEvent, slot: LiveSlot, log: list[StoredCommand] | None, **run: Any) -> bool:
    """Queue the sealed run of a slot, ahead of all other jobs. False when it is refused; then the slot has the reason.
    ``run``: as :func:`queue_evaluation` takes it."""
    values: dict[str, object] = {"reason_code": "", "speed_log": log}
    try:
        values["evaluation"] = queue_evaluation(track=event.race.track, priority=URGENT, sealed=True, **run)
    except UserFault as fault:
        values = {"reason_code": fault.code}
    LiveSlot.objects.filter(pk=slot.pk).update(**values)
    return "evaluation" in values


def hand_heat_over(slot: LiveSlot, evaluation: Evaluation) -> None:
    """Give a heat the run that was shown: its end decides the heat once it is unsealed. A run without a result is void,
    as it was shown."""
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
    """Discard runs computed with a car whose racer has left since."""
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
