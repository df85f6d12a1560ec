"""What organisers do in a live event, by the words that consoles and programs use for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from paddock.errors import UserFault

from .models import Entry, LiveEvent
from .selectors.live import running_order
from .services import live

if TYPE_CHECKING:
    from accounts.models import Racer


@dataclass(frozen=True)
class Wished:
    """What an act is asked with besides its word."""

    event: LiveEvent
    by: Racer
    seen: int | None
    now: datetime
    slot: int | None = None
    before: int | None = None
    racer: str = ""
    message: str = ""

    @property
    def who(self) -> dict[str, Any]:
        return {"event": self.event, "by": self.by, "seen": self.seen, "now": self.now}

    @property
    def place(self) -> dict[str, Any]:
        """Raises UserFault("live_slot_unknown") where no slot is named."""
        if self.slot is None:
            raise UserFault("live_slot_unknown")
        return {"slot": self.slot, **self.who}

    @property
    def entry(self) -> Entry:
        """Raises UserFault("live_not_in")."""
        found = Entry.objects.filter(race=self.event.race_id, racer__alias__iexact=self.racer).first()
        if found is None:
            raise UserFault("live_not_in")
        return found


def _move(wish: Wished) -> object:
    return live.move_slot(before=wish.before, **wish.place)


def _up(wish: Wished) -> object:
    """Before the one before: for consoles without scripts."""
    numbers = _movable(wish)
    index = numbers.index(wish.slot) if wish.slot in numbers else 0
    return live.move_slot(before=numbers[max(0, index - 1)] if numbers else None, **wish.place)


def _down(wish: Wished) -> object:
    numbers = _movable(wish)
    index = numbers.index(wish.slot) if wish.slot in numbers else 0
    return live.move_slot(before=numbers[index + 2] if index + 2 < len(numbers) else None, **wish.place)


def _movable(wish: Wished) -> list[int]:
    return [slot.pk for slot in running_order(wish.event) if slot.state in ("waiting", "called", "held")]


ACTS: dict[str, Callable[[Wished], object]] = {
    "begin": lambda wish: live.begin_live(**wish.who),
    "call": lambda wish: live.call_slot(**wish.place),
    "launch": lambda wish: live.launch(slot=wish.slot, **wish.who),
    "skip": lambda wish: live.skip_slot(**wish.place),
    "hold": lambda wish: live.hold_slot(**wish.place),
    "release": lambda wish: live.release_slot(**wish.place),
    "remove": lambda wish: live.remove_slot(**wish.place),
    "again": lambda wish: live.run_again(**wish.place),
    "move": _move,
    "up": _up,
    "down": _down,
    "add": lambda wish: live.add_late(entry=wish.entry, **wish.who),
    "pause": lambda wish: live.pause_live(**wish.who),
    "resume": lambda wish: live.resume_live(**wish.who),
    "end": lambda wish: live.end_live(**wish.who),
    "cancel": lambda wish: live.cancel_live(**wish.who),
    "message": lambda wish: live.say_to_spectators(message=wish.message, **wish.who),
    "winner": lambda wish: live.crown(entry=wish.entry, **wish.who),
    "podium": lambda wish: live.show_podium(**wish.who),
    "open": lambda wish: live.set_submissions(is_open=True, **wish.who),
    "close": lambda wish: live.set_submissions(is_open=False, **wish.who),
    "auto": lambda wish: live.set_auto_run(auto_run=True, **wish.who),
    "manual": lambda wish: live.set_auto_run(auto_run=False, **wish.who),
    "undo": lambda wish: live.undo_last(**wish.who),
}


def act(event: LiveEvent, action: str, *, by: Racer, seen: int | None, now: datetime, **said: Any) -> None:
    """Do one of :data:`ACTS`; ``said``: what :class:`Wished` has besides. Raises UserFault, KeyError."""
    ACTS[action](Wished(event, by, seen, now, **said))
