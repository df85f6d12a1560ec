"""From control points to a road: straights between the points, an arc of a chosen radius at each. No Django."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..checks import Points

Corner = tuple[float, float, float]  # x, y, radius of the arc that rounds it; metres


@dataclass(frozen=True)
class _Piece:
    """A straight (``bend`` 0) or an arc (``bend`` = 1/radius, positive to the left) from a pose; metres, radians."""

    x: float
    y: float
    heading: float
    length: float
    bend: float

    def at(self, s: float) -> tuple[float, float, float]:
        if self.bend == 0.0:
            return self.x + s * math.cos(self.heading), self.y + s * math.sin(self.heading), self.heading
        heading = self.heading + s * self.bend
        return (
            self.x + (math.sin(heading) - math.sin(self.heading)) / self.bend,
            self.y - (math.cos(heading) - math.cos(self.heading)) / self.bend,
            heading,
        )


def road(
    corners: Sequence[Corner], *, finish_m: float, length_m: float, width_m: float, spacing_m: float
) -> tuple[Points, Points, Points]:
    """Centre line, left and right border, each (N, 2), of the closed road through rounded ``corners``.

    The road starts ``finish_m`` metres after the last arc, on the straight to the first corner. It is scaled so that
    the polygon of its waypoints is ``length_m`` long; waypoints are evenly spaced at about ``spacing_m``. Raises
    ValueError where two arcs do not fit between their corners or the finish is not on the straight.
    """
    pieces = _pieces(corners)
    start = pieces[0]
    if not 0.0 < finish_m < start.length:
        raise ValueError(f"the finish must be on the first straight of {start.length:.2f} m, not at {finish_m} m")
    total = sum(piece.length for piece in pieces)
    count = round(length_m / spacing_m)
    poses = np.array([_walk(pieces, (finish_m + total * k / count) % total) for k in range(count)])
    centre = poses[:, :2]
    drawn = float(np.linalg.norm(np.roll(centre, -1, axis=0) - centre, axis=1).sum())
    middle = (centre.min(axis=0) + centre.max(axis=0)) / 2
    centre = (centre - middle) * (length_m / drawn)
    across = np.column_stack((-np.sin(poses[:, 2]), np.cos(poses[:, 2]))) * (width_m / 2)
    return centre, centre + across, centre - across


def _pieces(corners: Sequence[Corner]) -> list[_Piece]:
    """Straight, arc, straight, arc, ... beginning with the straight that leads to the first corner."""
    count = len(corners)
    headings, cuts, turns = [], [], []
    for (ax, ay, _), (bx, by, _) in zip((corners[-1], *corners[:-1]), corners, strict=True):
        headings.append(math.atan2(by - ay, bx - ax))
    for k in range(count):
        turn = math.remainder(headings[(k + 1) % count] - headings[k], math.tau)
        turns.append(turn)
        cuts.append(corners[k][2] * math.tan(abs(turn) / 2))
    pieces = []
    for k, (x, y, radius) in enumerate(corners):
        before_x, before_y, _ = corners[k - 1]
        heading = headings[k]
        straight = math.hypot(x - before_x, y - before_y) - cuts[k - 1] - cuts[k]
        if straight < -1e-6:
            raise ValueError(f"the arcs of corners {(k - 1) % count} and {k} overlap by {-straight:.2f} m")
        cos, sin = math.cos(heading), math.sin(heading)
        pieces.append(
            _Piece(before_x + cuts[k - 1] * cos, before_y + cuts[k - 1] * sin, heading, max(straight, 0.0), 0.0)
        )
        bend = math.copysign(1.0 / radius, turns[k])
        pieces.append(_Piece(x - cuts[k] * cos, y - cuts[k] * sin, heading, radius * abs(turns[k]), bend))
    return pieces


def _walk(pieces: list[_Piece], s: float) -> tuple[float, float, float]:
    for piece in pieces:
        if s <= piece.length:
            return piece.at(s)
        s -= piece.length
    return pieces[-1].at(pieces[-1].length)
