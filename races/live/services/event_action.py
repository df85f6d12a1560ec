"""The frame of every act in a live event: lock, version check, log entry, and undoing the last act."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, TypedDict

from django.db import transaction
from django.utils.dateparse import parse_datetime
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.acts import AuditAct, register
from core.audit.recording import record as record_act
from core.events import record
from paddock.errors import UserFault

from ...entries.selectors.visibility import can_organise
from ...events import LIVE_CHANGED, of_race
from ...models import HEAT_CARS, LiveEvent, LiveLog, LiveSlot, LiveState, SlotState
from ...models.live import UNDO_FOR

CONTROLLED = register(AuditAct("live.controlled", _("Live event controlled")))


@dataclass
class Act:
    """An act in progress. ``details``: more data for its log entry; ``final``: it cannot be undone."""

    event: LiveEvent
    details: dict[str, object] = field(default_factory=dict)
    final: bool = False

    def slot(self, slot: LiveSlot | int) -> LiveSlot:
        """A place of this event's running order, as it is now. Raises UserFault("live_slot_unknown")."""
        number = slot if isinstance(slot, int) else slot.pk
        related = ("racer__entry__racer", "racer__model__owner", "duel", "evaluation")
        slots = LiveSlot.objects.filter(event=self.event, pk=number).select_related(*related)
        found = slots.prefetch_related(HEAT_CARS).first()
        if found is None:
            raise UserFault("live_slot_unknown")
        self.details |= {"slot": found.pk, "round": found.round, "racer": found.driver_names}
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
    """Hold the event's lock during an act of an organiser, or of the clock (``by`` and ``seen`` None).

    At the end it increments the version, writes a log entry and records a change event; an exception inside rolls all
    back. ``event`` is refreshed afterwards. Raises UserFault ``race_not_yours``, ``live_changed`` after another act
    since ``seen``, ``live_over``, ``live_not_running``, ``live_has_begun``.
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
        LiveLog.objects.create(event=locked, at=now, by=by, action=action, told=act.details, undo=undo)
        publish_change(locked, now)
        if by is not None:
            record_act(CONTROLLED, locked, by=by, changes={"act": [None, action]})
    event.refresh_from_db()


def publish_change(event: LiveEvent, now: datetime) -> None:
    """Record that an event changed, for the pages that follow it."""
    record(LIVE_CHANGED, at=now, **of_race(event.race), version=event.version)


def _why_not(event: LiveEvent) -> str:
    if event.is_over:
        return "live_over"
    return "live_not_running" if event.state == LiveState.PLANNED else "live_has_begun"


_EVENT = ("state", "submissions_open", "roll_call", "auto_run", "message", "winner_id", "podium_at", "ended_at")
_SLOT = ("state", "position", "starts_at", "ends_at", "reason_code")


class EventSnapshot(TypedDict):
    """The values of an event and of its slots by id that an undo may have to bring back, as plain JSON."""

    event: dict[str, object]
    slots: dict[str, dict[str, object]]


class EventUndo(TypedDict):
    """An act's changes: each changed value of the event and row of a slot, before (None: new) and after."""

    event: dict[str, tuple[object, object]]
    slots: dict[str, tuple[dict[str, object] | None, dict[str, object]]]


def snapshot(event: LiveEvent) -> EventSnapshot:
    """What an undo may have to bring back, as plain JSON."""
    rows = LiveSlot.objects.filter(event=event).values("pk", *_SLOT)
    slots = {str(row.pop("pk")): {name: _plain(value) for name, value in row.items()} for row in rows}
    return {"event": {name: _plain(getattr(event, name)) for name in _EVENT}, "slots": slots}


def before_and_after(before: EventSnapshot, after: EventSnapshot) -> EventUndo:
    """An act's changes."""
    slots = {
        key: (before["slots"].get(key), row) for key, row in after["slots"].items() if before["slots"].get(key) != row
    }
    event = {name: (before["event"][name], value) for name, value in after["event"].items()}
    return {"event": {name: pair for name, pair in event.items() if pair[0] != pair[1]}, "slots": slots}


def undo_last(*, event: LiveEvent, by: Racer, seen: int | None, now: datetime) -> LiveLog:
    """Undo the last act that is not undone yet. Raises UserFault ``race_not_yours``, ``live_changed``,
    ``live_undo_nothing``, ``live_undo_late`` after two minutes, or once the run that was launched is on track."""
    with acting(event, "undo", by=by, seen=seen, now=now, states=tuple(LiveState)) as act:
        last = LiveLog.objects.filter(event=act.event, undone_at=None).exclude(action="undo").order_by("-pk").first()
        if last is None or last.undo is None:
            raise UserFault("live_undo_nothing")
        if now > last.at + UNDO_FOR or not _stands(act.event, last.undo, now):
            raise UserFault("live_undo_late")
        _bring_back(act.event, last.undo)
        LiveLog.objects.filter(pk=last.pk).update(undone_at=now)
        act.details["undone"] = last.action
        act.details |= {key: value for key, value in last.told.items() if key in ("racer", "slot")}
        act.final = True
    return last


def _stands(event: LiveEvent, undo: EventUndo, now: datetime) -> bool:
    """Whether the event is still as the act left it, and no spectator has seen a car move because of it."""
    present = snapshot(event)
    if any(present["event"][name] != after for name, (_before, after) in undo["event"].items()):
        return False
    for key, (_before, after) in undo["slots"].items():
        if present["slots"].get(key) != after:
            return False
        if after["state"] == SlotState.RUNNING and now >= (parse_datetime(str(after["starts_at"])) or now):
            return False
    return True


def _bring_back(event: LiveEvent, undo: EventUndo) -> None:
    for name, (before, _after) in undo["event"].items():
        setattr(event, name, before)  # Django reads times as they are written here
    for key, (before, _after) in undo["slots"].items():
        slots = LiveSlot.objects.filter(event=event, pk=int(key))
        if before is None:
            slots.update(state=SlotState.REMOVED)  # its sealed run goes with the event's end
        else:
            slots.update(**before)


def _plain(value: Any) -> Any:
    return value.isoformat() if isinstance(value, datetime) else value
