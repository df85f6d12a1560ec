"""An organiser's acts on places in the running order."""

from datetime import datetime

from django.db.models import Max

from accounts.models import Racer
from paddock.errors import UserFault

from ...models import LiveEvent, LiveSlot, SlotState
from ...models.live import TO_COME, UNDER_WAY
from .event_action import Act, acting
from .planning import slots_of
from .roll_call import require_stayed
from .sealing import prepare_after_commit

_MOVABLE = (*TO_COME, SlotState.HELD)


def call_slot(*, event: LiveEvent, slot: LiveSlot | int, by: Racer | None, seen: int | None, now: datetime) -> LiveSlot:
    """Call a racer to the start: theirs is the next run. A racer called before waits again. Raises UserFault as
    ``acting``, ``live_slot_state`` unless the slot waits."""
    with acting(event, "call", by=by, seen=seen, now=now, states=UNDER_WAY) as act:
        found = _in(act, slot, SlotState.WAITING)
        LiveSlot.objects.filter(event=act.event, state=SlotState.CALLED).update(state=SlotState.WAITING)
        _set(found, SlotState.CALLED)
        prepare_after_commit(act.event, now)
    return found


def skip_slot(*, event: LiveEvent, slot: LiveSlot | int, by: Racer | None, seen: int | None, now: datetime) -> LiveSlot:
    """Let an attempt pass undriven. Raises UserFault as ``acting``, ``live_slot_state``."""
    return _to(event, slot, SlotState.SKIPPED, "skip", _MOVABLE, by, seen, now)


def hold_slot(
    *, event: LiveEvent, slot: LiveSlot | int, by: Racer | None, seen: int | None, now: datetime, reason: str = ""
) -> LiveSlot:
    """Keep an attempt back until it is released. Raises UserFault as ``acting``, ``live_slot_state``."""
    return _to(event, slot, SlotState.HELD, "hold", TO_COME, by, seen, now, reason)


def release_slot(
    *, event: LiveEvent, slot: LiveSlot | int, by: Racer | None, seen: int | None, now: datetime
) -> LiveSlot:
    """Let a held, skipped or removed attempt wait again. Raises UserFault likewise, or ``live_left``."""
    states = (SlotState.HELD, SlotState.SKIPPED, SlotState.REMOVED)
    return _to(event, slot, SlotState.WAITING, "release", states, by, seen, now)


def remove_slot(
    *, event: LiveEvent, slot: LiveSlot | int, by: Racer | None, seen: int | None, now: datetime
) -> list[LiveSlot]:
    """Remove a racer's remaining places from the event. Driven runs stay. Raises UserFault as ``acting``,
    ``live_slot_state``, ``live_drawn`` for a heat: the draw decides the pairs."""
    with acting(event, "remove", by=by, seen=seen, now=now, states=UNDER_WAY) as act:
        found = _in(act, slot, *_MOVABLE, SlotState.SKIPPED)
        if found.duel_id is not None:
            raise UserFault("live_drawn")
        theirs = [
            one
            for one in slots_of(act.event)
            if one.racer_id == found.racer_id and one.state in (*_MOVABLE, SlotState.SKIPPED)
        ]
        for one in theirs:
            _set(one, SlotState.REMOVED)
        prepare_after_commit(act.event, now)
    return theirs


def run_again(*, event: LiveEvent, slot: LiveSlot | int, by: Racer, seen: int | None, now: datetime) -> LiveSlot:
    """Give a racer one more attempt of a round, as the next run. The earlier attempt still counts. A skipped heat waits
    again; a decided one stands. Raises UserFault as ``acting``, ``live_slot_state`` unless it was driven or skipped,
    ``live_drawn``."""
    with acting(event, "again", by=by, seen=seen, now=now, states=UNDER_WAY) as act:
        found = _in(act, slot, SlotState.DONE, SlotState.SKIPPED)
        if found.duel_id is not None:
            return _heat_again(act, found, now)
        require_stayed(found)
        theirs = LiveSlot.objects.filter(racer=found.racer, round=found.round)
        attempt = (theirs.aggregate(most=Max("attempt"))["most"] or 0) + 1
        new = LiveSlot.objects.create(
            event=act.event, racer=found.racer, round=found.round, attempt=attempt, position=2**31 - 1
        )
        _put_next(act, new)
        act.details["attempt"] = attempt
        prepare_after_commit(act.event, now)
    new.refresh_from_db()
    return new


def move_slot(
    *, event: LiveEvent, slot: LiveSlot | int, before: LiveSlot | int | None, by: Racer, seen: int | None, now: datetime
) -> LiveSlot:
    """Put an attempt that is still to come before another that is, or with None behind all. Raises UserFault as
    ``acting``, ``live_slot_state`` where one of the two is not to come."""
    with acting(event, "move", by=by, seen=seen, now=now, states=UNDER_WAY) as act:
        target = None if before is None else _in(act, before, *_MOVABLE)
        found = _in(act, slot, *_MOVABLE)
        if target is None or target.pk != found.pk:
            rows = [one for one in slots_of(act.event) if one.pk != found.pk]
            rows.insert(len(rows) if target is None else [one.pk for one in rows].index(target.pk), found)
            _number(rows)
        prepare_after_commit(act.event, now)
    found.refresh_from_db()
    return found


def _to(
    event: LiveEvent,
    slot: LiveSlot | int,
    state: SlotState,
    action: str,
    states: tuple[str, ...],
    by: Racer | None,
    seen: int | None,
    now: datetime,
    reason: str = "",
) -> LiveSlot:
    with acting(event, action, by=by, seen=seen, now=now, states=UNDER_WAY) as act:
        found = _in(act, slot, *states)
        if state == SlotState.WAITING:
            require_stayed(found)
        _set(found, state, reason)
        prepare_after_commit(act.event, now)
    return found


def _in(act: Act, slot: LiveSlot | int, *states: str) -> LiveSlot:
    found = act.slot(slot)
    if found.state not in states:
        raise UserFault("live_slot_state", state=found.get_state_display())
    return found


def _heat_again(act: Act, slot: LiveSlot, now: datetime) -> LiveSlot:
    if slot.state == SlotState.DONE:
        raise UserFault("live_drawn")
    _set(slot, SlotState.WAITING)
    _put_next(act, slot)
    prepare_after_commit(act.event, now)
    return slot


def _put_next(act: Act, slot: LiveSlot) -> None:
    rows = [one for one in slots_of(act.event) if one.pk != slot.pk]
    ahead = [index for index, one in enumerate(rows) if one.state not in _MOVABLE]
    rows.insert(max(ahead, default=-1) + 1, slot)
    _number(rows)


def _set(slot: LiveSlot, state: SlotState, reason: str = "") -> None:
    slot.state, slot.reason_code = state, reason
    slot.save(update_fields=["state", "reason_code"])


def _number(rows: list[LiveSlot]) -> None:
    for position, one in enumerate(rows, start=1):
        one.position = position
    LiveSlot.objects.bulk_update(rows, ["position"])
