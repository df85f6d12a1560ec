"""Tests whether a point is on the road, border lines included."""

import math
from functools import cached_property

import numpy as np

from .checks import Points

BAND_M = 0.25  # height of a band; a band of a usual track holds about ten border segments
ON_LINE_M = 1e-9  # a point this near to a border line is on it

_Edge = tuple[float, float, float, float, float]


class Road:
    """The area of closed outlines (N, 2), even-odd, cut into horizontal bands so that one test needs few segments."""

    def __init__(self, *outlines: Points) -> None:
        edges: list[_Edge] = []
        for border in outlines:
            points: list[tuple[float, float]] = [(float(x), float(y)) for x, y in border]
            for (ax, ay), (bx, by) in zip(points, [*points[1:], points[0]], strict=True):
                edges.append((ax, ay, bx - ax, by - ay, (bx - ax) ** 2 + (by - ay) ** 2))
        self.low_m = min(min(ay, ay + dy) for _, ay, _, dy, _ in edges)
        high = max(max(ay, ay + dy) for _, ay, _, dy, _ in edges)
        self._bands: list[list[_Edge]] = [[] for _ in range(int((high - self.low_m) / BAND_M) + 1)]
        for edge in edges:
            _, ay, _, dy, _ = edge
            first = self._band(min(ay, ay + dy) - 2 * ON_LINE_M)
            last = self._band(max(ay, ay + dy) + 2 * ON_LINE_M)
            for number in range(max(first, 0), min(last, len(self._bands) - 1) + 1):
                self._bands[number].append(edge)

    @cached_property
    def rows(self) -> tuple[Points, np.ndarray]:
        """(M, 5): start, step and squared length of the edges, band by band from the lowest at ``low_m``, and
        (bands + 1,): where each band begins; for C."""
        ends = np.cumsum([0, *map(len, self._bands)])
        return np.array([edge for band in self._bands for edge in band], np.float64).reshape(-1, 5), ends

    def _band(self, y: float) -> int:
        return math.floor((y - self.low_m) / BAND_M)

    def contains(self, x: float, y: float) -> bool:
        """True on the road and on its border lines. NaN and infinity are not on the road."""
        if not (math.isfinite(x) and math.isfinite(y)):
            return False
        # a point within rounding of the lowest or highest line belongs to the outermost band
        number = self._band(y)
        if number < 0 or number >= len(self._bands):
            if y < self.low_m - ON_LINE_M or number > len(self._bands):
                return False
            number = 0 if number < 0 else len(self._bands) - 1
        odd = False
        for ax, ay, dx, dy, square in self._bands[number]:
            px = x - ax
            py = y - ay
            turn = dx * py - dy * px
            if turn * turn <= ON_LINE_M * ON_LINE_M * square:
                along = dx * px + dy * py
                if 0.0 <= along <= square:
                    return True
                if px * px + py * py <= ON_LINE_M * ON_LINE_M:
                    return True
            if (py >= 0.0) != (py >= dy) and (turn < 0.0) == (dy < 0.0):
                odd = not odd
        return odd
