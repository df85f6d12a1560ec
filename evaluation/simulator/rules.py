"""The rules of a race, as plain values that cross a pipe as JSON."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

TIME_TRIAL = "time_trial"
RACE_TYPES = (TIME_TRIAL,)
DIRECTIONS = ("ccw", "cw")


@dataclass(frozen=True)
class RaceRules:
    """What a race asks and punishes. Raises ValueError at construction when a value makes no sense.

    ``max_resets`` covers all laps; 0 ends the run at the first fault. Penalties are stood still on the track, in whole
    control steps (1/15 s, rounded up). Defaults: deepracer-simapp, evaluation_worker.py.
    """

    race_type: str = TIME_TRIAL
    laps: int = 3
    off_track_penalty_ms: int = 2000
    collision_penalty_ms: int = 5000
    max_resets: int = 10_000
    max_simulated_ms: int = 180_000
    seed: int = 0
    direction: str = "ccw"

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
        ):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise ValueError(f"{name} must be a whole number of at least {least}, not {value!r}")

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RaceRules:
        """The rules that :meth:`to_dict` wrote. Raises TypeError for an unknown key, ValueError for a bad value."""
        return cls(**data)


def penalty_steps(penalty_ms: int, control_hz: float) -> int:
    """Control steps that a penalty lasts, rounded up."""
    return math.ceil(penalty_ms * control_hz / 1000.0 - 1e-9)
