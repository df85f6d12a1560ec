"""Driven lines and how they are thinned: fewer points, never more than a centimetre off. No Django."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paddock.geometry.checks import Points

ERROR_M = 0.01
JUMP_M = 0.6  # the fastest car moves 0.27 m in a step; a longer one is a reset and is not drawn
SPEED_CLASSES = 6
TOP_SPEED_MPS = 4.0

XY = tuple[float, float]


@dataclass(frozen=True)
class Trajectory:
    """A line to draw on a map: ``points`` (x, y) in metres in driving order.

    ``speeds`` (m/s, one a point) colours it in ``SPEED_CLASSES`` steps of ``scale`` (m/s, from slow to fast).
    ``style`` is a word added to the CSS classes (letters, digits, hyphens), to tell one line
    from another. Raises ValueError.
    """

    points: Sequence[Sequence[float]]
    speeds: Sequence[float] | None = None
    style: str = ""
    scale: tuple[float, float] = (0.0, TOP_SPEED_MPS)

    def __post_init__(self) -> None:
        if self.speeds is not None and len(self.speeds) != len(self.points):
            raise ValueError(f"{len(self.speeds)} speeds for {len(self.points)} points")
        if not all(character.isascii() and (character.isalnum() or character == "-") for character in self.style):
            raise ValueError(f"style must be one CSS word, not {self.style!r}")

    def strokes(self) -> list[tuple[int | None, Points]]:
        """(speed class or None, thinned points (n, 2)) pieces that join up, broken only where the car was reset."""
        points = np.array([point[:2] for point in self.points], dtype=np.float64).reshape(-1, 2)
        classes = self._classes()
        result: list[tuple[int | None, Points]] = []
        start = 0
        for end in range(1, len(points) + 1):
            broken = end == len(points) or not math.dist(points[end], points[end - 1]) <= JUMP_M
            if not broken and (classes is None or classes[end] == classes[start]):
                continue
            # A change of colour shares its point with the next piece; a reset does not.
            piece = points[start : end if broken else end + 1]
            if len(piece) > 1 and np.isfinite(piece).all():
                result.append((None if classes is None else classes[start], simplify(piece)))
            start = end
        return result

    def _classes(self) -> list[int] | None:
        if self.speeds is None:
            return None
        slow, fast = self.scale
        share = np.nan_to_num((np.asarray(self.speeds, dtype=np.float64) - slow) / max(fast - slow, 0.1))
        return np.clip((share * SPEED_CLASSES).astype(int), 0, SPEED_CLASSES - 1).tolist()


def simplify(points: Points, error_m: float = ERROR_M) -> Points:
    """The fewest of the points that the method of Douglas and Peucker keeps within ``error_m`` of all; ends stay."""
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    todo = [(0, len(points) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        a, step = points[first], points[last] - points[first]
        apart = points[first + 1 : last] - a
        square = float(step @ step)
        t = np.clip(apart @ step / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(apart))
        off = np.linalg.norm(apart - t[:, None] * step, axis=1)
        worst = int(off.argmax())
        if off[worst] > error_m:
            middle = first + 1 + worst
            keep[middle] = True
            todo += [(first, middle), (middle, last)]
    return points[keep]


def simplify_loop(points: Points, error_m: float = ERROR_M) -> Points:
    """:func:`simplify` for a closed line whose first point is not repeated; row 0 stays."""
    far = int(np.linalg.norm(points - points[0], axis=1).argmax())
    there = simplify(points[: far + 1], error_m)
    back = simplify(np.concatenate((points[far:], points[:1])), error_m)
    return np.concatenate((there[:-1], back[:-1]))
