"""The numbered turns of a track in a driving direction."""

import math
from typing import NamedTuple

import numpy as np

from paddock.geometry.character import corners_of, curvature_along
from paddock.geometry.track import TrackGeometry

BESIDE_M = 0.25  # from the border to the middle of the turn's name


class TrackTurn(NamedTuple):
    """A corner of :mod:`paddock.geometry.character`. Metres from the finish, below the length of a lap: ``to_m`` is
    less than ``from_m`` where the turn goes on across the line. At ``apex_m`` half of the turn is driven; (x, y) is a
    place for its number beside the road there; ``degrees`` is positive to the left."""

    number: int
    from_m: float
    apex_m: float
    to_m: float
    x: float
    y: float
    degrees: float

    def contains(self, metres: float) -> bool:
        """Whether the turn includes the place so far from the finish."""
        if self.from_m < self.to_m:
            return self.from_m <= metres < self.to_m
        return metres >= self.from_m or metres < self.to_m


def turns_of(geometry: TrackGeometry, direction: str) -> list[TrackTurn]:
    """The turns in the order in which a lap in ``direction`` passes their apexes, numbered from 1."""
    track = geometry.in_direction(direction)
    step = curvature_along(track)[1]
    found = []
    for first, turned in corners_of(track):
        so_far = np.cumsum(turned)
        half = int(np.argmax(np.abs(so_far) >= abs(so_far[-1]) / 2))
        from_m, apex_m, to_m = ((first + rows) * step % track.length for rows in (0, half, len(turned)))
        degrees = math.degrees(float(so_far[-1]))
        x, y = _beside(track, apex_m, degrees)
        found.append((apex_m, from_m, to_m, x, y, degrees))
    return [
        TrackTurn(
            number, round(from_m, 2), round(apex_m, 2), round(to_m, 2), round(x, 2), round(y, 2), round(degrees, 1)
        )
        for number, (apex_m, from_m, to_m, x, y, degrees) in enumerate(sorted(found), 1)
    ]


def _beside(track: TrackGeometry, metres: float, degrees: float) -> tuple[float, float]:
    """A place outside of the turn; inside of it where another part of the road lies there."""
    left, right = track.half_widths_at(metres)
    sides = (-right - BESIDE_M, left + BESIDE_M)
    places = [track.point_at(metres, offset)[:2] for offset in (sides if degrees > 0 else reversed(sides))]
    return next((place for place in places if not track.on_road(*place)), places[0])
