"""The log of speed commands of a live run as rows keep it, and what of it a moment of the run has seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from paddock.rules.race import RaceRules
from paddock.rules.speed import SpeedCommand

from .models import LiveEvent, LiveRacer

Command = dict[str, Any]  # {"at_ms", "mode", "value", "by"}, and "car" of a duel; 0 where it is not named


def rules_with(rules: RaceRules, log: list[Command] | None) -> RaceRules:
    """A run's rules with its log of commands."""
    commands = tuple(SpeedCommand(one["at_ms"], one["mode"], one["value"], car_of(one)) for one in log or ())
    return replace(rules, speed_commands=commands)


def start_log(event: LiveEvent, racers: Sequence[LiveRacer | None]) -> list[Command] | None:
    """The log that a run begins with; ``racers``: those of its cars, by their numbers."""
    if not event.speed_control:
        return None
    begin = [(number, racer.speed) for number, racer in enumerate(racers) if racer is not None and racer.speed]
    return [{"at_ms": 0, **speed, "car": number} for number, speed in begin] or None


def commanded(log: list[Command] | None, played_ms: int, car: int = 0) -> list[Command]:
    """The commands of a log for a car that have taken effect ``played_ms`` after the start. The others are of the
    future."""
    told = ("at_ms", "mode", "value", "by")
    mine = (one for one in log or () if car_of(one) == car)
    return [{name: one[name] for name in told} for one in mine if one["at_ms"] <= played_ms]


def car_of(command: Command) -> int:
    """The number of the car that is commanded."""
    return int(command.get("car", 0))


def wishes_of(written: Any) -> list[Command]:
    """What is commanded next, each car's last wish, the oldest first. A row from before duels had one wish."""
    if written is None:
        return []
    return [written] if isinstance(written, dict) else list(written)
