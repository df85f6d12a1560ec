"""The segments of a centre line between waypoints, and the position of points along them."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .checks import Points, cross

_ROWS = 64  # compared with all others at a time

ROUNDING_M = 1e-9  # a point so little behind a waypoint is abreast of it

Segment = tuple[float, float, float, float, float, float, float, float, float, float, float, float, float]


class Projection(NamedTuple):
    """The place of a point along the track, metres and radians.

    ``distance`` in [0, length) from the finish in driving direction (on an open track from the start: below 0 before
    it, above the length beyond the end); ``offset`` from the centre line, positive to the left; ``heading`` of the
    centre line, from -pi to pi; ``index`` of the segment, which begins at waypoint ``index``.
    """

    distance: float
    offset: float
    heading: float
    index: int  # type: ignore[assignment]  # hides the method of tuples


def segments(
    centre: Points, tangents: Points, starts: Sequence[float], length: float, wide: Points, count: int
) -> Iterator[Segment]:
    """One tuple for each of ``count`` segments: start, step, tangent, change of tangent, step . tangent, step . change,
    distance, length, and the greatest offset for the quick answer (the road's edge, ``wide`` (N,))."""
    for index in range(count):
        after = (index + 1) % len(centre)
        (ax, ay), (bx, by) = centre[index].tolist(), centre[after].tolist()
        (tx, ty), (nx, ny) = tangents[index].tolist(), tangents[after].tolist()
        ex, ey, ux, uy = bx - ax, by - ay, nx - tx, ny - ty
        size = (starts[after] if after else length) - starts[index]
        reach = float(max(wide[index], wide[after]))
        yield ax, ay, ex, ey, tx, ty, ux, uy, ex * tx + ey * ty, ex * ux + ey * uy, starts[index], size, reach


def root(segment: Segment, x: float, y: float) -> float | None:
    """Share of the segment in [0, 1) whose line across the track meets the point, or None."""
    ax, ay, _, _, tx, ty, ux, uy, along, bend, *_ = segment
    behind = (x - ax) * tx + (y - ay) * ty
    slope = (x - ax) * ux + (y - ay) * uy - along
    if behind < -ROUNDING_M or behind + slope - bend >= 0.0:
        return None
    behind = max(behind, 0.0)
    below = math.sqrt(slope * slope + 4.0 * behind * bend) - slope
    return 2.0 * behind / below if below > 0.0 else 0.0


def foot(segment: Segment, x: float, y: float) -> tuple[float, float]:
    """(squared distance of the point from the segment, share of the segment at the nearest point in [0, 1])."""
    ax, ay, ex, ey = segment[:4]
    px, py = x - ax, y - ay
    t = min(max((px * ex + py * ey) / (ex * ex + ey * ey), 0.0), 1.0)
    px -= t * ex
    py -= t * ey
    return px * px + py * py, t


def reaches(centre: Points, across: Points, border: Points, line: Points, step: Points) -> Points:
    """Metres from each centre point along ``across`` (unit vectors) to the border; (N,). ``border``: its row of each
    centre point; ``line``, ``step``: the starts of the border's segments, and the steps to their ends.

    The rows of some files are not square to the track (AWS_track: border points 2 m apart on a road of 0.6 m). Where
    the line across misses the border at a tight corner the row's border point counts.
    """
    result = np.linalg.norm(border - centre, axis=1)
    for first in range(0, len(centre), _ROWS):
        part = slice(first, first + _ROWS)
        rays = across[part, None]
        apart = line - centre[part, None]
        turn = cross(rays, step)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = cross(apart, step) / turn
            share = cross(apart, rays) / turn
        near = along < 1.2 * result[part, None] + 0.05
        hits = (turn != 0) & (share >= 0) & (share <= 1) & (along > 0) & near
        least = np.where(hits, along, np.inf).min(axis=1)
        result[part] = np.where(hits.any(axis=1), least, result[part])
    return result
