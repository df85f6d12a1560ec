"""The clock of live events reveals played runs, advances events that run automatically and ends forgotten ones.

Its state is in rows and its writes are guarded updates, so several clocks may run at once and resume after a pause.
"""

import logging
from datetime import datetime, timedelta

from django.db.models import Q

from core.streams import life
from evaluation.models import State
from paddock.errors import UserFault

from ...models import REVEALED_AFTER, LiveEvent, LiveSlot, LiveState, SlotState
from ...models.live import INTERRUPTED_AFTER, OVER, UNDO_FOR
from .order import hold_slot, release_slot
from .planning import cancel_live
from .roll_call import LACKS_CAR, lacks_car, model_of, note_qualifying, throw_away
from .sealing import next_slots, prepare_ahead, tidy_ended
from .show import begin_live, end_live, interrupt, launch, ready_ms, reveal
from .speed import settle_speed

logger = logging.getLogger(__name__)
LEFT_ALONE = timedelta(hours=6)  # then an event ends by itself
LAST_WORDS = timedelta(minutes=2)  # between the last run and the end of an event that runs by itself


def tick_live(*, now: datetime) -> int:
    """Do what has become due. Returns how many things. One event that fails keeps no other waiting."""
    due = Q(state__in=(LiveState.RUNNING, LiveState.PAUSED)) | Q(state=LiveState.PLANNED, starts_at__lte=now)
    done = 0
    for event in LiveEvent.objects.filter(due).select_related("race").order_by("starts_at", "pk"):
        done += _safely(event, now)
    sealed = Q(slots__evaluation__sealed=True) & ~Q(slots__state=SlotState.RUNNING)
    for event in LiveEvent.objects.filter(sealed, state__in=OVER, last_at__lt=now - UNDO_FOR).distinct():
        done += tidy_ended(event=event, now=now)
    return done


def _safely(event: LiveEvent, now: datetime) -> int:
    try:
        return _move_on(event, now)
    except UserFault as fault:  # an organiser was quicker
        logger.info("The live event of %s does not move on: %s", event.race.slug, fault.code)
    except Exception:  # the others go on; this one is tried again at the next tick
        logger.exception("The live event of %s cannot move on.", event.race.slug)
    return 0


def _move_on(event: LiveEvent, now: datetime) -> int:
    if event.race.cancelled_at is not None:
        return _give_up(event, now)
    if event.state == LiveState.PLANNED:
        if event.auto_run:
            begin_live(event=event, by=None, seen=event.version, now=now)
            return 1
        if event.starts_at <= now - LEFT_ALONE:
            cancel_live(event=event, by=None, seen=event.version, now=now)
            return 1
        return 0
    settled = settle_speed(event=event, now=now) + _release_ready(event, now)
    running = LiveSlot.objects.filter(event=event, state=SlotState.RUNNING).first()
    if running is not None:
        if _is_interrupted(event, running, now):
            interrupt(event=event, slot=running, now=now)
            return settled + 1
        due = running.ends_at is not None and running.ends_at <= now - REVEALED_AFTER
        return settled + int(due and reveal(slot=running, now=now))
    if event.last_at <= now - LEFT_ALONE:
        end_live(event=event, by=None, seen=event.version, now=now)
        return 1
    done = settled + prepare_ahead(event=event, now=now) + _compute_again(event, now)
    if event.auto_run and event.state == LiveState.RUNNING:
        done += _next_by_itself(event, now)
    return done


def _next_by_itself(event: LiveEvent, now: datetime) -> int:
    coming = next_slots(event)
    if not coming:
        if LiveSlot.objects.filter(event=event, state=SlotState.HELD, reason_code="live_car_queued").exists():
            return 0  # a car is in the queue
        if event.last_at <= now - LAST_WORDS:
            end_live(event=event, by=None, seen=event.version, now=now)
            return 1
        return 0
    if event.last_at > now - timedelta(seconds=event.gap_s):
        return 0
    first = coming[0]
    try:
        ready_ms(first)
    except UserFault as fault:
        if fault.code not in LACKS_CAR:
            return 0  # it is being computed
        hold_slot(event=event, slot=first, by=None, seen=event.version, now=now, reason=fault.code)
        return 1
    launch(event=event, slot=first, by=None, seen=event.version, now=now)
    return 1


def _is_interrupted(event: LiveEvent, slot: LiveSlot, now: datetime) -> bool:
    """Whether the site was away for so long a part of a run that its spectators missed it. Notes that it is here now.
    The clock looks every second. While it was away, a stream process that lived went on showing the run."""
    before, event.clock_at = event.clock_at, now
    LiveEvent.objects.filter(pk=event.pk).update(clock_at=now)
    if before is None or slot.starts_at is None or slot.ends_at is None:
        return False
    missed = min(now, slot.ends_at) - max(before, slot.starts_at)
    return missed >= INTERRUPTED_AFTER and not life.lived_through(before, now)


def _release_ready(event: LiveEvent, now: datetime) -> int:
    """Release the slots held for want of a car that now have one. Returns their number."""
    if event.auto_run and event.state == LiveState.RUNNING:  # runs interrupted before it ran automatically
        for slot in LiveSlot.objects.filter(event=event, state=SlotState.HELD, reason_code="live_interrupted"):
            release_slot(event=event, slot=slot, by=None, seen=event.version, now=now)
    held = LiveSlot.objects.filter(event=event, state=SlotState.HELD, reason_code__in=LACKS_CAR)
    related = ("racer__entry__racer", "racer__entry__best__evaluation__model__owner", "racer__model__owner")
    done = 0
    for slot in held.select_related(*related).order_by("position", "pk"):
        assert slot.racer is not None, "a heat has the cars of its draw"
        if model_of(slot.racer) is not None:
            if slot.racer.qualified_rank is None and slot.racer.entry.best_id is not None:
                note_qualifying([slot.racer])
            release_slot(event=event, slot=slot, by=None, seen=event.version, now=now)
            done += 1
        elif slot.reason_code != (reason := lacks_car(slot.racer)):
            LiveSlot.objects.filter(pk=slot.pk, state=SlotState.HELD).update(reason_code=reason)
    return done


def _compute_again(event: LiveEvent, now: datetime) -> int:
    """Discard runs that ended through no fault of the car (a platform fault, an operator's stop), to compute them
    again."""
    done = 0
    for slot in next_slots(event):
        run = slot.evaluation
        if run is not None and (run.state == State.STOPPED or run.is_platform_fault):
            throw_away(slot, run, now)
            done += 1
    return done


def _give_up(event: LiveEvent, now: datetime) -> int:
    """Cancel the rest of the event of a cancelled race."""
    if event.state == LiveState.PLANNED:
        cancel_live(event=event, by=None, seen=event.version, now=now)
    elif not LiveSlot.objects.filter(event=event, state=SlotState.RUNNING).exists():
        end_live(event=event, by=None, seen=event.version, now=now)
    else:
        return int(any(reveal(slot=slot, now=now) for slot in event.slots.filter(state=SlotState.RUNNING)))
    return 1
