"""One act in a live event: under its lock, on the version that was seen, with an entry in the log and a way back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any

from django.db import transaction

from core.events import record
from paddock.errors import UserFault

from ...events import LIVE_CHANGED, of_race
from ...models import HEAT_CARS, LiveEvent, LiveLog, LiveSlot, LiveState
from ...selectors.visibility import can_organise
from .undo import before_and_after, snapshot

if TYPE_CHECKING:
    from accounts.models import Racer


@dataclass
class Act:
    """What is being done. ``told``: what the log says of it besides; ``final``: it cannot be undone."""

    event: LiveEvent
    told: dict[str, Any] = field(default_factory=dict)
    final: bool = False

    def slot(self, slot: LiveSlot | int) -> LiveSlot:
        """A place of this event's running order, as it is now. Raises UserFault("live_slot_unknown")."""
        number = slot if isinstance(slot, int) else slot.pk
        related = ("racer__entry__racer", "racer__model__owner", "duel", "evaluation")
        slots = LiveSlot.objects.filter(event=self.event, pk=number).select_related(*related)
        found = slots.prefetch_related(HEAT_CARS).first()
        if found is None:
            raise UserFault("live_slot_unknown")
        self.told |= {"slot": found.pk, "round": found.round}
        self.told["racer"] = found.who
        return found


@contextmanager
def acting(
    event: LiveEvent,
    action: str,
    *,
    by: Racer | None,
    seen: int | None,
    now: datetime,
    states: tuple[str, ...] = (LiveState.PLANNED, LiveState.RUNNING, LiveState.PAUSED),
) -> Iterator[Act]:
    """Hold the event's lock while something is done in it by an organiser, or by the clock (``by`` and ``seen`` None).

    At the end the version goes up, the log has a new entry, and an event tells that something changed; whatever is
    raised inside undoes it all. ``event`` itself is fresh afterwards. Raises UserFault ``race_not_yours``,
    ``live_changed`` when somebody did something since ``seen``, ``live_over``, ``live_not_running``,
    ``live_has_begun``.
    """
    with transaction.atomic():
        locked = LiveEvent.objects.select_for_update(of=("self",)).select_related("race__track").get(pk=event.pk)
        if by is not None and not can_organise(by, locked.race):
            raise UserFault("race_not_yours")
        if seen is not None and seen != locked.version:
            raise UserFault("live_changed")
        if locked.state not in states:
            raise UserFault(_why_not(locked))
        before = snapshot(locked)
        act = Act(locked)
        yield act
        locked.version += 1
        locked.last_at = now
        locked.save()
        undo = None if act.final else before_and_after(before, snapshot(locked))
        LiveLog.objects.create(event=locked, at=now, by=by, action=action, told=act.told, undo=undo)
        record(LIVE_CHANGED, at=now, **of_race(locked.race), version=locked.version)
    event.refresh_from_db()


def _why_not(event: LiveEvent) -> str:
    if event.is_over:
        return "live_over"
    return "live_not_running" if event.state == LiveState.PLANNED else "live_has_begun"
