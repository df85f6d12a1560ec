"""The next runs of a live event are computed while the one before is played, and sealed until they have been."""

from __future__ import annotations

import logging
from datetime import datetime
from functools import partial

from django.db import transaction

from evaluation.queue_order import URGENT
from evaluation.services import queue_evaluation
from paddock.errors import UserFault

from ...live_rules import attempt_rules
from ...models import HEAT_CARS, LiveEvent, LiveSlot, SlotState
from ...models.live import TO_COME, UNDER_WAY
from ...speed_log import rules_with, start_log
from .heats import arrange_heats, seal_heat
from .roll import lacks_car, model_of, take_out_left, throw_away

logger = logging.getLogger(__name__)
AHEAD = 2


@transaction.atomic
def prepare_ahead(*, event: LiveEvent, now: datetime) -> int:
    """Queue the sealed runs of the next slots that have none, before all that others wait for. Returns how many.

    A slot whose racer has no model (yet) has the reason in ``reason_code`` and is passed over.
    """
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
        try:
            evaluation = queue_evaluation(
                owner=slot.racer.entry.racer,
                model=model,
                track=event.race.track,
                rules=rules_with(attempt_rules(event), log),
                priority=URGENT,
                sealed=True,
                now=now,
            )
        except UserFault as fault:
            LiveSlot.objects.filter(pk=slot.pk).update(reason_code=fault.code)
            continue
        LiveSlot.objects.filter(pk=slot.pk).update(evaluation=evaluation, reason_code="", speed_log=log)
        queued += 1
    return queued


def next_slots(event: LiveEvent) -> list[LiveSlot]:
    """What is still to come, in the order in which it comes: who is called first."""
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
    transaction.on_commit(partial(_prepare_safely, event, now), robust=True)


def clear_up(event: LiveEvent, now: datetime) -> int:
    """Throw away what was computed for slots that will never be shown. The caller holds the event."""
    slots = LiveSlot.objects.filter(event=event, evaluation__sealed=True).exclude(state=SlotState.RUNNING)
    thrown = 0
    for slot in slots.select_related("evaluation"):
        if slot.evaluation is not None:
            throw_away(slot, slot.evaluation, now)
            thrown += 1
    return thrown


def _prepare_safely(event: LiveEvent, now: datetime) -> None:
    try:
        prepare_ahead(event=event, now=now)
    except Exception:  # what was done stands; the clock tries again
        logger.exception("The next runs of the live event of %s cannot be computed ahead.", event.race_id)
