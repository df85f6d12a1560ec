"""What a racer commands of a car's speed while a race is shown live: a log that is part of the run's rules.

The modes are those of the old console's races with a crowd (its simulator's car control): metres a second, a multiple
of what the model wants, a share of the fastest, so much more or less; beside them a cap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

SLOWEST_MPS, FASTEST_MPS = 0.1, 4.0
MOST_COMMANDS = 200
_DIGITS = 3  # of metres a second, as those of a continuous action

# What each mode makes of the speed that the model wants, in metres a second.
_MODES: Mapping[str, Callable[[float, float], float]] = {
    "multiplier": lambda wanted, value: wanted * value,
    "cap": lambda wanted, value: min(wanted, value),
    "absolute": lambda wanted, value: value,
    "percent_max": lambda wanted, value: FASTEST_MPS * value / 100.0,
    "offset": lambda wanted, value: wanted + value,
}
MODEL_SPEED = "model_speed"
MODES = (MODEL_SPEED, *_MODES)
# Of each mode the least and the most that its value may be; the 0.5 to 1.5 are those of the finals of 2023.
VALUES: Mapping[str, tuple[float, float]] = {
    MODEL_SPEED: (0.0, 0.0),
    "multiplier": (0.5, 1.5),
    "cap": (SLOWEST_MPS, FASTEST_MPS),
    "absolute": (SLOWEST_MPS, FASTEST_MPS),
    "percent_max": (100.0 * SLOWEST_MPS / FASTEST_MPS, 100.0),
    "offset": (SLOWEST_MPS - FASTEST_MPS, FASTEST_MPS - SLOWEST_MPS),
}


@dataclass(frozen=True)
class SpeedCommand:
    """From ``at_ms`` of the run on (simulated time) car number ``car`` drives so, until its next command.

    ``mode``: one of :data:`MODES`; ``value``: a factor, metres a second, per cent, or metres a second more or less, as
    the mode says; 0 for ``model_speed``, which ends all others. Raises ValueError for what is none.
    """

    at_ms: int
    mode: str
    value: float = 0.0
    car: int = 0

    def __post_init__(self) -> None:
        for name, least in (("at_ms", 0), ("car", 0)):
            number = getattr(self, name)
            if not isinstance(number, int) or isinstance(number, bool) or number < least:
                raise ValueError(f"{name} must be a whole number of at least {least}, not {number!r}")
        if self.mode not in VALUES:
            raise ValueError(f"mode must be one of {MODES}, not {self.mode!r}")
        least_value, most = VALUES[self.mode]
        value = self.value
        if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
            raise ValueError(f"value must be a number, not {value!r}")
        if not least_value <= value <= most:
            raise ValueError(f"value must be from {least_value:g} to {most:g} for {self.mode}, not {value!r}")

    def speed_of(self, wanted_mps: float) -> float:
        """The speed that is driven where the model wants ``wanted_mps``: always from 0.1 to 4 m/s, in whole mm/s."""
        if self.mode == MODEL_SPEED:
            return wanted_mps
        commanded = _MODES[self.mode](wanted_mps, float(self.value))
        return round(min(max(commanded, SLOWEST_MPS), FASTEST_MPS), _DIGITS)


def check_log(commands: Iterable[SpeedCommand]) -> None:
    """Refuse a log whose commands are too many or not in the order of their times, of each car one at a time. Raises
    ValueError."""
    last: dict[int, int] = {}
    count = 0
    for one in commands:
        count += 1
        if one.at_ms <= last.get(one.car, -1):
            raise ValueError(f"speed_commands of car {one.car} must be in the order of their times, at {one.at_ms} ms")
        last[one.car] = one.at_ms
    if count > MOST_COMMANDS:
        raise ValueError(f"speed_commands must be at most {MOST_COMMANDS}, not {count}")
