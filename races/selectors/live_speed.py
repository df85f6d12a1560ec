"""Who commands a car's speed in a live event, and what of the commands may be told."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from django.db.models import Q, QuerySet

from ..models import HEAT_CARS, Duel, LiveEvent, LiveRacer, LiveSlot, SlotState
from ..speed_log import car_of, commanded, wishes_of
from .live import live_events_visible_to

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer


LATE = "live_speed_late"


def late_for(car: int) -> str:
    """What a slot has as ``speed_reason`` where the last command for this car expired."""
    return f"{LATE} {car}" if car else LATE


def commands_speed(racer: Racer | AnonymousUser | None, mine: LiveRacer) -> bool:
    """Whether somebody commands the speed of a car: its racer, and the deputy they named while that one may see the
    event. Organisers and staff do not. Twin of :func:`live_racers_commanded_by`."""
    if racer is None or not racer.is_authenticated:
        return False
    if racer.pk not in (mine.entry.racer_id, mine.deputy_id) or mine.entry.withdrawn_at is not None:
        return False
    return live_events_visible_to(racer).filter(pk=mine.event_id).exists()


def live_racers_commanded_by(racer: Racer | AnonymousUser | None) -> QuerySet[LiveRacer]:
    """All racers of live events whose car's speed somebody commands. Twin of :func:`commands_speed`."""
    racers = LiveRacer.objects.select_related("entry__racer", "deputy", "event__race")
    if racer is None or not racer.is_authenticated:
        return racers.none()
    events = live_events_visible_to(racer).order_by().values("pk")
    mine = Q(entry__racer_id=racer.pk) | Q(deputy_id=racer.pk)
    return racers.filter(mine, event__in=events, entry__withdrawn_at=None).order_by("pk")


def slots_of_racer(racer: LiveRacer) -> QuerySet[LiveSlot]:
    """Their attempts, or the heats that they are in."""
    heats = Duel.objects.filter(cars__entry=racer.entry_id)
    return LiveSlot.objects.filter(Q(racer=racer) | Q(duel__in=heats), event=racer.event_id)


def slot_driven_by(racer: LiveRacer) -> tuple[LiveSlot, int] | None:
    """The slot on track or counting down in which the racer drives, and their car's number in it."""
    running = slots_of_racer(racer).filter(state=SlotState.RUNNING).select_related("racer__entry", "duel")
    slot = running.prefetch_related(HEAT_CARS).first()
    if slot is None:
        return None
    numbers = [entry.pk for entry in slot.starting]
    return (slot, numbers.index(racer.entry_id)) if racer.entry_id in numbers else None


def played_ms(slot: LiveSlot, now: datetime) -> int:
    """How much of a run has passed, in milliseconds: negative while it counts down."""
    return -1 if slot.starts_at is None else (now - slot.starts_at) // timedelta(milliseconds=1)


def present_speed(slot: LiveSlot, now: datetime, car: int = 0) -> dict[str, Any] | None:
    """The command that a car on track drives by now; None while it drives as its model wants."""
    if slot.state != SlotState.RUNNING:
        return None
    past = commanded(slot.speed_log, played_ms(slot, now), car)
    return past[-1] if past and past[-1]["mode"] != "model_speed" else None


def speed_document(event: LiveEvent, mine: LiveRacer, now: datetime) -> dict[str, Any]:
    """What who commands a car is told: how their runs begin, and of the run on track what has taken effect and what
    comes. Whether a command that comes was computed is not told before its moment."""
    driven = slot_driven_by(mine)
    found: dict[str, Any] = {
        "racer": mine.entry.racer.alias,
        "deputy": None if mine.deputy is None else mine.deputy.alias,
        "start": mine.speed,
        "driving": driven is not None,
        "played_ms": None,
        "log": [],
        "coming": None,
        "wished": None,
        "reason": "",
    }
    if driven is None or event.is_over:
        return found
    slot, car = driven
    coming = slot.speed_next if slot.speed_next is not None and car_of(slot.speed_next) == car else None
    wished = next((one for one in wishes_of(slot.speed_wish) if car_of(one) == car), None)
    passed = played_ms(slot, now)
    return found | {
        "played_ms": max(0, passed),
        "log": commanded(slot.speed_log, passed, car),
        "coming": None if coming is None else {key: coming[key] for key in ("at_ms", "mode", "value", "by")},
        "wished": None if wished is None else {key: wished[key] for key in ("mode", "value", "by")},
        "reason": LATE if slot.speed_reason == late_for(car) else "",
    }
