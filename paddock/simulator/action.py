"""The action space of ``model_metadata.json``: converts network outputs to commands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from paddock.errors import UserFault

from .physics import PADDOCK_CAR

DISCRETE = "discrete"
CONTINUOUS = "continuous"
_STEERING_DIGITS, _SPEED_DIGITS = 2, 3  # of a continuous action
_STEPS = (10.0**-_STEERING_DIGITS, 10.0**-_SPEED_DIGITS)
_SLACK = 1e-6  # of a step, for the roundings of float64 itself


class Action(NamedTuple):
    """A command to the car. ``index`` is the place in a discrete list, None for a continuous space."""

    steering_deg: float  # positive is left
    speed_mps: float
    index: int | None  # type: ignore[assignment]  # hides the method of tuples


@dataclass(frozen=True)
class ActionSpace:
    """A list of (steering in degrees, speed in m/s), or the (low, high) ranges of both."""

    kind: str
    actions: tuple[tuple[float, float], ...] = ()
    steering: tuple[float, float] = (0.0, 0.0)
    speed: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> ActionSpace:
        """The action space of a checked metadata file; numbers may be strings. Raises ValueError, KeyError."""
        space = metadata["action_space"]
        if metadata.get("action_space_type", DISCRETE) == CONTINUOUS:
            return cls.continuous(
                *((float(space[key]["low"]), float(space[key]["high"])) for key in ("steering_angle", "speed"))
            )
        return cls.discrete([(float(action["steering_angle"]), float(action["speed"])) for action in space])

    @classmethod
    def discrete(cls, actions: Sequence[tuple[float, float]]) -> ActionSpace:
        """A list of (steering in degrees, speed in m/s)."""
        if not actions:
            raise ValueError("a discrete action space needs at least one action")
        commands = (_within_limits(*action) for action in actions)
        return cls(DISCRETE, actions=tuple((round(steering, 4) + 0.0, round(speed, 4)) for steering, speed in commands))

    @classmethod
    def continuous(cls, steering: tuple[float, float], speed: tuple[float, float]) -> ActionSpace:
        """Ranges (low, high) of steering in degrees and of speed in m/s."""
        for low, high in (steering, speed):
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise ValueError(f"a range needs low < high, not {low} and {high}")
        return cls(CONTINUOUS, steering=steering, speed=speed)

    @cached_property
    def size(self) -> int:
        return len(self.actions) if self.kind == DISCRETE else 2

    @cached_property
    def commands(self) -> tuple[Action, ...]:
        return tuple(Action(*action, index) for index, action in enumerate(self.actions))

    @property
    def ranges(self) -> list[list[float]] | None:
        """The ranges in plain JSON values, or None for a list of actions; for :func:`is_clear`."""
        return None if self.kind == DISCRETE else [list(self.steering), list(self.speed)]

    def decode(self, output: np.ndarray | list[float] | int, step: int = 0) -> Action:
        """The command in a network's ``output``: an array or list of ``size`` values, or the index of an action.

        Discrete: the first of the greatest scores. Continuous: clipped to [-1, 1], scaled to the ranges
        (deepracer-simapp, multi_agent_coach/action_space_configs.py), clipped to the limits of the car, and rounded to
        0.01 degrees and 0.001 m/s. Raises UserFault("non_finite_action"), which names ``step``; ValueError for a wrong
        size.
        """
        if type(output) is int and self.kind == DISCRETE:
            if 0 <= output < len(self.commands):
                return self.commands[output]
            raise ValueError(f"there is no action {output} among {self.size}")
        # for so few numbers a list is faster than numpy
        values: list[float] = output if type(output) is list else np.asarray(output).reshape(-1).tolist()
        if len(values) != self.size:
            raise ValueError(f"the network answered {len(values)} values, the action space has {self.size}")
        if not math.isfinite(sum(values)) and not all(map(math.isfinite, values)):  # finite ones may add up to more
            raise UserFault("non_finite_action", step=step)
        if self.kind == DISCRETE:
            return self.commands[values.index(max(values))]
        return Action(*_continuous(values, (self.steering, self.speed)), None)


def is_clear(values: Sequence[float], bound: float, ranges: Sequence[Sequence[float]] | None) -> bool:
    """Whether every answer within ``bound`` of ``values`` is the same command; False for values that are not finite.
    ``ranges``: :attr:`ActionSpace.ranges`."""
    if not all(map(math.isfinite, values)):
        return False
    if ranges is None:
        best = max(values)
        chosen = values.index(best)
        others = (*values[:chosen], *values[chosen + 1 :])
        return not others or best - max(others) > 2 * bound
    for value, (low, high), finest in zip(values, ranges, _STEPS, strict=True):
        beyond = abs(value) - 1.0
        if beyond > bound:  # all are clipped to the same end
            continue
        step = 0.5 * (high - low) / finest  # steps of the command for 1 of an answer
        place = (low / finest + (value + 1.0) * step) % 1.0
        # commands change half-way between two steps; the limits of the car are whole steps
        if abs(place - 0.5) <= bound * step + _SLACK:
            return False
    return True


def _continuous(values: Sequence[float], ranges: Sequence[Sequence[float]]) -> tuple[float, float]:
    """Steering in degrees and speed in m/s of two values of a continuous space."""
    steering, speed = (
        low + (min(max(value, -1.0), 1.0) + 1.0) / 2.0 * (high - low)
        for value, (low, high) in zip(values, ranges, strict=True)
    )
    steering, speed = _within_limits(steering, speed)
    # rounded once: an earlier rounding would move the places where commands change, see is_clear
    return round(steering, _STEERING_DIGITS) + 0.0, round(speed, _SPEED_DIGITS)


def _within_limits(steering_deg: float, speed: float) -> tuple[float, float]:
    """Clip to the limits of the car. Raises ValueError for numbers that are not finite."""
    limit = PADDOCK_CAR.max_steering_deg
    steering_deg = min(max(float(steering_deg), -limit), limit)
    speed = min(max(float(speed), PADDOCK_CAR.min_speed), PADDOCK_CAR.max_speed)
    if not (math.isfinite(steering_deg) and math.isfinite(speed)):
        raise ValueError("steering and speed must be finite")
    return steering_deg, speed
