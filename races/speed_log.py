"""The log of speed commands of a live run as rows keep it, and what of it a moment of the run has seen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from paddock.rules.race import RaceRules
from paddock.rules.speed import SpeedCommand

from .models import LiveEvent, LiveRacer

Command = dict[str, Any]  # {"at_ms", "mode", "value", "by"}


def rules_with(rules: RaceRules, log: list[Command] | None) -> RaceRules:
    """A run's rules with its log of commands."""
    commands = tuple(SpeedCommand(one["at_ms"], one["mode"], one["value"]) for one in log or ())
    return replace(rules, speed_commands=commands)


def start_log(event: LiveEvent, racer: LiveRacer) -> list[Command] | None:
    """The log that a run of the racer begins with."""
    return [{"at_ms": 0, **racer.speed}] if event.speed_control and racer.speed else None


def commanded(log: list[Command] | None, played_ms: int) -> list[Command]:
    """The commands of a log that have taken effect ``played_ms`` after the start. The others are of the future."""
    told = ("at_ms", "mode", "value", "by")
    return [{name: one[name] for name in told} for one in log or () if one["at_ms"] <= played_ms]
