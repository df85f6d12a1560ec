"""Taking back what was done last in a live event, for two minutes."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any

from django.db import transaction
from django.utils.dateparse import parse_datetime

from core.events import record
from paddock.errors import UserFault

from ...events import LIVE_CHANGED, of_race
from ...models import LiveEvent, LiveLog, LiveSlot, SlotState
from ...models.live import UNDO_FOR
from ...selectors.visibility import can_organise

if TYPE_CHECKING:
    from accounts.models import Racer

FOR = UNDO_FOR
_EVENT = ("state", "submissions_open", "roll_call", "auto_run", "message", "winner_id", "podium_at", "ended_at")
_SLOT = ("state", "position", "starts_at", "ends_at", "reason_code")
_TIMES = ("podium_at", "ended_at", "starts_at", "ends_at")

Snapshot = dict[str, Any]


def snapshot(event: LiveEvent) -> Snapshot:
    """What an undo may have to bring back, as plain JSON."""
    rows = LiveSlot.objects.filter(event=event).values("pk", *_SLOT)
    slots = {str(row.pop("pk")): {name: _plain(value) for name, value in row.items()} for row in rows}
    return {"event": {name: _plain(getattr(event, name)) for name in _EVENT}, "slots": slots}


def before_and_after(before: Snapshot, after: Snapshot) -> Snapshot:
    """What an act has changed: of each thing how it was (None: there was none) and how it is."""
    slots = {
        key: [before["slots"].get(key), row] for key, row in after["slots"].items() if before["slots"].get(key) != row
    }
    event = {name: [before["event"][name], value] for name, value in after["event"].items()}
    return {"event": {name: pair for name, pair in event.items() if pair[0] != pair[1]}, "slots": slots}


@transaction.atomic
def undo_last(*, event: LiveEvent, by: Racer, seen: int | None, now: datetime) -> LiveLog:
    """Take back what was done last and is not undone yet.

    Raises UserFault ``race_not_yours``, ``live_changed``, ``live_undo_nothing``, ``live_undo_late`` after two minutes,
    or once the run that was launched is on track.
    """
    locked = LiveEvent.objects.select_for_update(of=("self",)).select_related("race").get(pk=event.pk)
    if not can_organise(by, locked.race):
        raise UserFault("race_not_yours")
    if seen is not None and seen != locked.version:
        raise UserFault("live_changed")
    last = LiveLog.objects.filter(event=locked, undone_at=None).exclude(action="undo").order_by("-pk").first()
    if last is None or last.undo is None:
        raise UserFault("live_undo_nothing")
    if now > last.at + FOR or not _stands(locked, last.undo, now):
        raise UserFault("live_undo_late")
    _bring_back(locked, last.undo)
    locked.version += 1
    locked.last_at = now
    locked.save()
    LiveLog.objects.filter(pk=last.pk).update(undone_at=now)
    told = {"undone": last.action, **{key: last.told[key] for key in ("racer", "slot") if key in last.told}}
    LiveLog.objects.create(event=locked, at=now, by=by, action="undo", told=told)
    record(LIVE_CHANGED, at=now, **of_race(locked.race), version=locked.version)
    event.refresh_from_db()
    return last


def _stands(event: LiveEvent, undo: Snapshot, now: datetime) -> bool:
    """Whether all is still as the act left it, and nobody has seen a car move because of it."""
    present = snapshot(event)
    if any(present["event"][name] != after for name, (_before, after) in undo["event"].items()):
        return False
    for key, (_before, after) in undo["slots"].items():
        if present["slots"].get(key) != after:
            return False
        starts = after["starts_at"]
        if after["state"] == SlotState.RUNNING and now >= (parse_datetime(starts) or now):
            return False
    return True


def _bring_back(event: LiveEvent, undo: Snapshot) -> None:
    for name, (before, _after) in undo["event"].items():
        setattr(event, name, _python(name, before))
    for key, (before, _after) in undo["slots"].items():
        slots = LiveSlot.objects.filter(event=event, pk=int(key))
        if before is None:
            slots.update(state=SlotState.REMOVED)  # its sealed run goes with the event's end
        else:
            slots.update(**{name: _python(name, value) for name, value in before.items()})


def _plain(value: Any) -> Any:
    return value.isoformat() if isinstance(value, datetime) else value


def _python(name: str, value: Any) -> Any:
    return parse_datetime(value) if name in _TIMES and value is not None else value
