"""The organisers' actions in a live event, by the names that the console and the API use."""

from collections.abc import Callable
from datetime import datetime
from functools import partial

from accounts.models import Racer
from paddock.errors import UserFault

from ..models import Entry, LiveEvent
from . import services as live
from .selectors.events import running_order

# The services of the actions, by what else they take.
_OF_THE_EVENT: dict[str, Callable[..., object]] = {
    "begin": live.begin_live,
    "pause": live.pause_live,
    "resume": live.resume_live,
    "end": live.end_live,
    "cancel": live.cancel_live,
    "podium": live.show_podium,
    "open": partial(live.set_submissions, is_open=True),
    "close": partial(live.set_submissions, is_open=False),
    "auto": partial(live.set_auto_run, auto_run=True),
    "manual": partial(live.set_auto_run, auto_run=False),
    "undo": live.undo_last,
}
_OF_A_SLOT: dict[str, Callable[..., object]] = {
    "call": live.call_slot,
    "skip": live.skip_slot,
    "hold": live.hold_slot,
    "release": live.release_slot,
    "remove": live.remove_slot,
    "again": live.run_again,
    "move": live.move_slot,
    "up": live.move_slot,
    "down": live.move_slot,
}
_OF_AN_ENTRY: dict[str, Callable[..., object]] = {"add": live.add_late, "winner": live.crown}
ACTS = frozenset({*_OF_THE_EVENT, *_OF_A_SLOT, *_OF_AN_ENTRY, "launch", "message"})


def act(
    event: LiveEvent,
    action: str,
    *,
    by: Racer,
    seen: int | None,
    now: datetime,
    slot: int | None = None,
    before: int | None = None,
    racer: str = "",
    message: str = "",
) -> None:
    """Do one of :data:`ACTS`. ``racer``: an alias. Raises KeyError, UserFault as the services, ``live_slot_unknown``
    where no slot is named, ``live_not_in``."""
    context: dict[str, object] = {"event": event, "by": by, "seen": seen, "now": now}
    if action == "launch":
        live.launch(event=event, slot=slot, by=by, seen=seen, now=now)
    elif action == "message":
        live.set_message(event=event, message=message, by=by, seen=seen, now=now)
    elif action in _OF_AN_ENTRY:
        entry = Entry.objects.filter(race=event.race_id, racer__alias__iexact=racer).first()
        if entry is None:
            raise UserFault("live_not_in")
        _OF_AN_ENTRY[action](entry=entry, **context)
    elif action in _OF_THE_EVENT:
        _OF_THE_EVENT[action](**context)
    elif slot is None and action in _OF_A_SLOT:
        raise UserFault("live_slot_unknown")
    else:
        if action in ("up", "down"):  # for consoles without scripts
            context["before"] = _neighbour(event, slot, action)
        elif action == "move":
            context["before"] = before
        _OF_A_SLOT[action](slot=slot, **context)


def _neighbour(event: LiveEvent, number: int | None, action: str) -> int | None:
    """The place that a place moves before, one up or down; None behind all."""
    numbers = [slot.pk for slot in running_order(event) if slot.state in ("waiting", "called", "held")]
    index = numbers.index(number) if number in numbers else 0
    index = max(0, index - 1) if action == "up" else index + 2
    return numbers[index] if index < len(numbers) else None
