"""The speed commands of racers during a live run, a log that is part of the run's rules."""

# The modes are those of the car control in the old console's live races, and a cap.

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

SLOWEST_MPS, FASTEST_MPS = 0.1, 4.0
MOST_COMMANDS = 200
_DIGITS = 3  # of metres a second, as those of a continuous action

# The commanded speed of each mode from the model's speed and the value, m/s.
_MODES: Mapping[str, Callable[[float, float], float]] = {
    "multiplier": lambda wanted, value: wanted * value,
    "cap": lambda wanted, value: min(wanted, value),
    "absolute": lambda wanted, value: value,
    "percent_max": lambda wanted, value: FASTEST_MPS * value / 100.0,
    "offset": lambda wanted, value: wanted + value,
}
MODEL_SPEED = "model_speed"
MODES = (MODEL_SPEED, *_MODES)
# The range of each mode's value; 0.5 to 1.5 is that of the finals of 2023.
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
    """A command to car number ``car`` from ``at_ms`` (simulated) until its next command. ``value``: a factor, m/s, per
    cent or a difference in m/s, as the ``mode`` requires; 0 for ``model_speed``, which ends the others. Raises
    ValueError."""

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
        """The speed for the model's ``wanted_mps``: from 0.1 to 4 m/s, in whole mm/s."""
        if self.mode == MODEL_SPEED:
            return wanted_mps
        commanded = _MODES[self.mode](wanted_mps, float(self.value))
        return round(min(max(commanded, SLOWEST_MPS), FASTEST_MPS), _DIGITS)


def check_log(commands: Iterable[SpeedCommand]) -> None:
    """Raises ValueError for too many commands, and for those of a car that are not in the order of their times."""
    last: dict[int, int] = {}
    count = 0
    for one in commands:
        count += 1
        if one.at_ms <= last.get(one.car, -1):
            raise ValueError(f"speed_commands of car {one.car} must be in the order of their times, at {one.at_ms} ms")
        last[one.car] = one.at_ms
    if count > MOST_COMMANDS:
        raise ValueError(f"speed_commands must be at most {MOST_COMMANDS}, not {count}")
