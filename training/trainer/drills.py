"""Practising the places where the car leaves the road.

A car that nearly laps drives minutes from one fault to the next: of what sixteen cars drive between two updates, hardly
a second is before the bend that they cannot take. So half of them drill: their episodes begin shortly before a place
where a car has left the road or crashed of late, and end some seconds later, whatever happens. Where nobody fails any
more the places grow old with their last faults, and drilling there is driving as any other.
"""

from __future__ import annotations

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
    """How a car stands where a drill begins: a share of the road's width and radians, both to the left.

    A bend that cannot be taken from the centre line is taken from another place: whoever never is there never learns
    what that place is worth, and nothing draws the car towards it.
    """
    return rng.uniform(-ASIDE, ASIDE), math.radians(rng.uniform(-TURN_DEG, TURN_DEG))


class Drills:
    """Where cars have failed of late, on each way of a training."""

    def __init__(self, ways: int) -> None:
        self._places: list[deque[float]] = [deque(maxlen=_KEPT) for _ in range(ways)]

    def note(self, way: int, metres: float) -> None:
        """A car that explores has failed there."""
        self._places[way].append(metres)

    def note_looks(self, faults: Iterable[Fault]) -> None:
        """The policy has failed there without exploring: that is what has to be mended."""
        for way, metres in faults:
            self._places[way].extend([metres] * _LOOK_WEIGHT)

    def start_m(self, way: int, track: TrackGeometry, rng: np.random.Generator) -> float | None:
        """Where a drill on ``track`` begins, in metres from its finish line; None where nobody has failed."""
        places = self._places[way]
        if not places:
            return None
        start = places[int(rng.integers(len(places)))] - rng.uniform(*BEFORE_M)
        if track.is_open:
            return float(min(max(start, 0.0), track.length - OPEN_ROOM_M))
        return float(start % track.length)

    def state(self) -> list[list[float]]:
        """Plain numbers for a checkpoint."""
        return [list(places) for places in self._places]

    def restore(self, state: list[list[float]]) -> None:
        """Go on from :meth:`state`."""
        for places, kept in zip(self._places, state, strict=True):
            places.clear()
            places.extend(kept)
