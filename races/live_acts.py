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
class Asked:
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


def _move(asked: Asked) -> object:
    return live.move_slot(before=asked.before, **asked.place)


def _up(asked: Asked) -> object:
    """Before the one before: for consoles without scripts."""
    numbers = _movable(asked)
    index = numbers.index(asked.slot) if asked.slot in numbers else 0
    return live.move_slot(before=numbers[max(0, index - 1)] if numbers else None, **asked.place)


def _down(asked: Asked) -> object:
    numbers = _movable(asked)
    index = numbers.index(asked.slot) if asked.slot in numbers else 0
    return live.move_slot(before=numbers[index + 2] if index + 2 < len(numbers) else None, **asked.place)


def _movable(asked: Asked) -> list[int]:
    return [slot.pk for slot in running_order(asked.event) if slot.state in ("waiting", "called", "held")]


ACTS: dict[str, Callable[[Asked], object]] = {
    "begin": lambda asked: live.begin_live(**asked.who),
    "call": lambda asked: live.call_slot(**asked.place),
    "launch": lambda asked: live.launch(slot=asked.slot, **asked.who),
    "skip": lambda asked: live.skip_slot(**asked.place),
    "hold": lambda asked: live.hold_slot(**asked.place),
    "release": lambda asked: live.release_slot(**asked.place),
    "remove": lambda asked: live.remove_slot(**asked.place),
    "again": lambda asked: live.run_again(**asked.place),
    "move": _move,
    "up": _up,
    "down": _down,
    "add": lambda asked: live.add_late(entry=asked.entry, **asked.who),
    "pause": lambda asked: live.pause_live(**asked.who),
    "resume": lambda asked: live.resume_live(**asked.who),
    "end": lambda asked: live.end_live(**asked.who),
    "cancel": lambda asked: live.cancel_live(**asked.who),
    "message": lambda asked: live.say_to_spectators(message=asked.message, **asked.who),
    "winner": lambda asked: live.crown(entry=asked.entry, **asked.who),
    "podium": lambda asked: live.show_podium(**asked.who),
    "open": lambda asked: live.set_submissions(is_open=True, **asked.who),
    "close": lambda asked: live.set_submissions(is_open=False, **asked.who),
    "auto": lambda asked: live.set_auto_run(auto_run=True, **asked.who),
    "manual": lambda asked: live.set_auto_run(auto_run=False, **asked.who),
    "undo": lambda asked: live.undo_last(**asked.who),
}


def act(event: LiveEvent, action: str, *, by: Racer, seen: int | None, now: datetime, **said: Any) -> None:
    """Do one of :data:`ACTS`; ``said``: what :class:`Asked` has besides. Raises UserFault, KeyError."""
    ACTS[action](Asked(event, by, seen, now, **said))
