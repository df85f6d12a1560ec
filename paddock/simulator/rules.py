"""The rules of a race, as plain values that cross a pipe as JSON."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

TIME_TRIAL, OBJECT_AVOIDANCE, HEAD_TO_HEAD = "time_trial", "object_avoidance", "head_to_head"
RACE_TYPES = (TIME_TRIAL, OBJECT_AVOIDANCE, HEAD_TO_HEAD)
DIRECTIONS = ("ccw", "cw")

# Of the track's lanes: the one beside the inner border and the one beside the outer border, whatever the direction.
INNER, OUTER = "inner", "outer"
LANES = (INNER, OUTER)

MAX_BOXES = 10  # console API
MAX_BOTS = 6  # console API
MAX_CARS = 4  # in one world, model against model
BOT_SPEED_RANGE_MPS = (0.2, 4.0)
# What forms and environments propose, where a type of race needs some and nobody has said how many.
PROPOSED_BOXES = 6
PROPOSED_BOTS = 4


@dataclass(frozen=True)
class BoxPlace:
    """Where a box stands: the share of a lap driven there from the finish line, in [0, 1), and the lane it stands in
    the middle of."""

    fraction: float
    lane: str

    def __post_init__(self) -> None:
        _check_number("fraction", self.fraction, 0.0, 1.0)
        if self.fraction >= 1.0:
            raise ValueError("fraction must be less than 1")
        if self.lane not in LANES:
            raise ValueError(f"lane must be one of {LANES}, not {self.lane!r}")


@dataclass(frozen=True)
class RaceRules:
    """What a race asks and punishes. Raises ValueError at construction when a value makes no sense; whether boxes have
    room on a certain track is for :mod:`paddock.simulator.course`.

    ``max_resets`` covers all laps; 0 ends the run at the first fault. Penalties are stood still on the track, in whole
    control steps (1/15 s, rounded up). Defaults: deepracer-simapp, evaluation_worker.py; they are the defaults
    of races, commands, environments, forms and API too, which take them from here.

    Object avoidance: ``boxes`` (fixed places) or ``random_boxes`` (so many, drawn from the seed at least
    ``box_distance_m`` apart along the track), 1 to 10; at the ``mercy_resets``-th reset near one box the car is put
    behind it (0: never), because the same car in the same place would do the same for ever. Simapp has this rule
    (ENABLE_MERCY_RESET, with 3) but off: its runs differ.

    Head-to-head: ``bots`` cars of ``bot_speed_mps``, 1 to 6, which change lanes every ``bot_lane_change_ms`` (least,
    most; drawn from the seed) if ``bot_lane_changes``, and pause for ``bot_pause_ms`` when they are hit or a crash is
    their fault; or 0 bots, and submitted cars race each other.
    """

    race_type: str = TIME_TRIAL
    laps: int = 3
    off_track_penalty_ms: int = 2000
    collision_penalty_ms: int = 5000
    max_resets: int = 10_000
    max_simulated_ms: int = 180_000
    seed: int = 0
    direction: str = "ccw"
    boxes: tuple[BoxPlace, ...] = ()
    random_boxes: int = 0
    box_distance_m: float = 2.0
    mercy_resets: int = 3
    bots: int = 0
    bot_speed_mps: float = 1.0
    bot_lane_changes: bool = False
    bot_lane_change_ms: tuple[int, int] = (3000, 5000)
    bot_pause_ms: int = 2000

    def __post_init__(self) -> None:
        if self.race_type not in RACE_TYPES:
            raise ValueError(f"race_type must be one of {RACE_TYPES}, not {self.race_type!r}")
        if self.direction not in DIRECTIONS:
            raise ValueError(f"direction must be one of {DIRECTIONS}, not {self.direction!r}")
        for name, least in (
            ("laps", 1),
            ("off_track_penalty_ms", 0),
            ("collision_penalty_ms", 0),
            ("max_resets", 0),
            ("max_simulated_ms", 1),
            ("seed", 0),
            ("random_boxes", 0),
            ("mercy_resets", 0),
            ("bots", 0),
            ("bot_pause_ms", 0),
        ):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise ValueError(f"{name} must be a whole number of at least {least}, not {value!r}")
        self._check_objects()

    def _check_objects(self) -> None:
        count = len(self.boxes) + self.random_boxes
        if self.boxes and self.random_boxes:
            raise ValueError("boxes have fixed places or random ones, not both")
        if self.race_type == OBJECT_AVOIDANCE and not 1 <= count <= MAX_BOXES:
            raise ValueError(f"object avoidance needs 1 to {MAX_BOXES} boxes, not {count}")
        if self.race_type != OBJECT_AVOIDANCE and count:
            raise ValueError("only object avoidance has boxes")
        if self.race_type != HEAD_TO_HEAD and self.bots:
            raise ValueError("only head-to-head has bots")
        if self.bots > MAX_BOTS:
            raise ValueError(f"bots must be at most {MAX_BOTS}, not {self.bots}")
        _check_number("box_distance_m", self.box_distance_m, 0.0, math.inf)
        _check_number("bot_speed_mps", self.bot_speed_mps, *BOT_SPEED_RANGE_MPS)
        least, most = self.bot_lane_change_ms
        if not 0 < least <= most:
            raise ValueError(f"bot_lane_change_ms must be (least, most) milliseconds, not {self.bot_lane_change_ms!r}")

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RaceRules:
        """The rules that :meth:`to_dict` wrote, also after a way through JSON. Raises TypeError for an unknown key,
        ValueError for a bad value."""
        values = dict(data)
        if "boxes" in values:
            values["boxes"] = tuple(BoxPlace(**box) for box in values["boxes"])
        if "bot_lane_change_ms" in values:
            values["bot_lane_change_ms"] = tuple(values["bot_lane_change_ms"])
        return cls(**values)


def _check_number(name: str, value: float, least: float, most: float) -> None:
    if not isinstance(value, int | float) or isinstance(value, bool) or not least <= value <= most:
        raise ValueError(f"{name} must be a number from {least} to {most}, not {value!r}")


def penalty_steps(penalty_ms: int, control_hz: float) -> int:
    """Control steps that a penalty lasts, rounded up."""
    return math.ceil(penalty_ms * control_hz / 1000.0 - 1e-9)
