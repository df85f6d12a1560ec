"""Episodes that start shortly before places where the car leaves the road.

Cars that nearly lap drive hardly a second between two updates before the bend that they fail. So half of them drill:
their episodes begin shortly before a recent fault and end some seconds later.
"""

import math
from collections import deque
from collections.abc import Iterable

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.simulator.envs.setting import OPEN_ROOM_M

DRILL_STEPS = 60  # of an episode: four seconds
BEFORE_M = (0.5, 3.0)  # so far before the fault it begins
ASIDE, TURN_DEG = 0.3, 25.0  # at most: of the road's width, and from its direction, to either side
_KEPT = 32  # the latest faults, of all cars on a way
_LOOK_WEIGHT = 4  # a fault without exploring counts for so many with

Fault = tuple[int, float]  # the number of a way, and metres from its finish line


def astray(rng: np.random.Generator) -> tuple[float, float]:
    """The position of a car where a drill begins: a share of the road's width and radians, both to the left. A car that
    starts only on the centre line never learns the value of a better position."""
    return rng.uniform(-ASIDE, ASIDE), math.radians(rng.uniform(-TURN_DEG, TURN_DEG))


class Drills:
    """The recent faults on each way of a training."""

    def __init__(self, ways: int) -> None:
        self._places: list[deque[float]] = [deque(maxlen=_KEPT) for _ in range(ways)]

    def note(self, way: int, metres: float) -> None:
        """Record the fault of an exploring car."""
        self._places[way].append(metres)

    def note_looks(self, faults: Iterable[Fault]) -> None:
        """Record faults without exploration, which weigh more."""
        for way, metres in faults:
            self._places[way].extend([metres] * _LOOK_WEIGHT)

    def start_m(self, way: int, track: TrackGeometry, rng: np.random.Generator) -> float | None:
        """The start of a drill on ``track`` in metres from its finish line; None without a fault on this way."""
        places = self._places[way]
        if not places:
            return None
        start = places[int(rng.integers(len(places)))] - rng.uniform(*BEFORE_M)
        if track.is_open:
            return float(min(max(start, 0.0), track.length - OPEN_ROOM_M))
        return float(start % track.length)

    def state(self) -> list[list[float]]:
        return [list(places) for places in self._places]

    def restore(self, state: list[list[float]]) -> None:
        for places, kept in zip(self._places, state, strict=True):
            places.clear()
            places.extend(kept)
