"""Checks that three lines of points form a track on which cars can race."""

# The bounds accept every community file (lengths 16-90 m, widths 0.6-2 m, spacing 0.06-0.97 m) and circuits at a tenth
# of their size (up to 710 m), and reject files in centimetres or with swapped columns.

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from paddock.errors import UserFault

Points = npt.NDArray[np.float64]
Floats = npt.NDArray[np.floating]  # of any precision

DUPLICATE_M = 0.02  # deepracer-simapp drops a waypoint nearer than this to the one before (DIST_THRESHOLD)
MIN_WAYPOINTS = 8
MAX_WAYPOINTS = 2000
MIN_LENGTH_M = 5.0
MAX_LENGTH_M = 1000.0
MIN_WIDTH_M = 0.3
MAX_WIDTH_M = 4.0
MAX_COORDINATE_M = 1000.0
MAX_TURN_DEG = 120.0
OPEN_GAP_FACTOR = 1.5

_BLOCK = 256


def clean_rows(centre: Any, inner: Any, outer: Any, is_open: bool | None = False) -> tuple[Points, Points, Points]:
    """Three equal (N, 2) float64 arrays: finite, without duplicate points, the first row kept and not repeated.
    ``is_open``: whether the rows must be an open track, None for either. Raises UserFault."""
    try:
        rows = [np.array(part, dtype=np.float64) for part in (centre, inner, outer)]
    except (TypeError, ValueError):
        raise UserFault("track_shape", shape="not a table of numbers") from None
    shapes = [part.shape for part in rows]
    if any(part.ndim != 2 or part.shape[1] != 2 for part in rows) or len(set(shapes)) != 1:
        raise UserFault("track_shape", shape=", ".join(str(shape) for shape in shapes))
    bad = ~np.isfinite(np.hstack(rows)).all(axis=1)
    if bad.any():
        raise UserFault("track_not_finite", row=int(np.argmax(bad)))
    furthest = max((float(np.abs(part).max(initial=0.0)) for part in rows), default=0.0)
    if furthest > MAX_COORDINATE_M:
        raise UserFault("track_far_away", limit_m=int(MAX_COORDINATE_M))

    keep = _distinct(rows[0])
    if len(keep) < MIN_WAYPOINTS:
        raise UserFault("track_too_few_points", points=len(keep), limit=MIN_WAYPOINTS)
    if len(keep) > MAX_WAYPOINTS:
        raise UserFault("track_too_large", points=len(keep), limit=MAX_WAYPOINTS)
    rows = [np.ascontiguousarray(part[keep]) for part in rows]
    found = ends_apart(rows[0])
    if is_open is not None and found != is_open:
        gap = round(math.dist(rows[0][-1], rows[0][0]), 2)
        raise UserFault("track_open" if found else "track_not_open", gap_m=gap)
    return rows[0], rows[1], rows[2]


def ends_apart(centre: Points) -> bool:
    """Whether the ends of a line lie farther apart than one and a half of its longest step."""
    steps = np.linalg.norm(np.diff(centre, axis=0), axis=1)
    return math.dist(centre[-1], centre[0]) > OPEN_GAP_FACTOR * float(steps.max())


def check_road(centre: Points, inner: Points, outer: Points) -> None:
    """Refuse a loop of wrong length or width, with a line that turns back or crosses, or without borders around it.
    Raises UserFault."""
    check_way(centre, np.roll(centre, -1, axis=0) - centre)
    check_widths(inner, outer)
    for first, second, line, other in (
        (inner, None, "inner border", "inner border"),
        (outer, None, "outer border", "outer border"),
        (inner, outer, "inner border", "outer border"),
        (centre, inner, "centre line", "inner border"),
        (centre, outer, "centre line", "outer border"),
    ):
        found = find_crossing(first, second)
        if found is not None:
            raise UserFault("track_borders_cross", line=line, row=found[0], other_line=other, other_row=found[1])
    small, large = sorted((inner, outer), key=lambda border: abs(signed_area(border)))
    if not (inside(centre, small[0]) and inside(large, centre[0])):
        raise UserFault("track_borders_apart")


def check_way(centre: Points, steps: Points) -> None:
    """Refuse a centre line that is too long or too short, turns back or crosses itself. ``steps``: from each point to
    the next, one fewer than points of an open line."""
    is_open = len(steps) < len(centre)
    lengths = np.linalg.norm(steps, axis=1)
    length = float(lengths.sum())
    if not MIN_LENGTH_M <= length <= MAX_LENGTH_M:
        code, limit_m, wanted_m = ("track_too_long", MAX_LENGTH_M, 0.95 * MAX_LENGTH_M)
        if length < MIN_LENGTH_M:
            code, limit_m, wanted_m = ("track_too_short", MIN_LENGTH_M, 1.05 * MIN_LENGTH_M)
        scale = f"{wanted_m / max(length, 1e-9):.2g}"
        raise UserFault(code, length_m=round(length, 2), limit_m=limit_m, scale=scale)
    unit = steps / lengths[:, None]
    before = np.roll(unit, 1, axis=0)
    turn = np.degrees(np.arctan2(np.abs(cross(before, unit)), (before * unit).sum(axis=1)))
    if is_open:
        turn[0] = 0.0
    if float(turn.max()) > MAX_TURN_DEG:
        raise UserFault("track_turns_back", row=int(turn.argmax()), degrees=round(float(turn.max())))
    found = find_crossing(centre, is_open=is_open)
    if found is not None:
        raise UserFault("track_self_crossing", row=found[0], other_row=found[1])


def check_widths(inner: Points, outer: Points) -> None:
    widths = np.linalg.norm(inner - outer, axis=1)
    worst = int(widths.argmin())
    if widths[worst] < MIN_WIDTH_M:
        raise UserFault("track_too_narrow", row=worst, width_m=round(float(widths[worst]), 3), limit_m=MIN_WIDTH_M)
    worst = int(widths.argmax())
    if widths[worst] > MAX_WIDTH_M:
        raise UserFault("track_too_wide", row=worst, width_m=round(float(widths[worst]), 3), limit_m=MAX_WIDTH_M)


def cross(a: Points, b: Points) -> Points:
    """z of the cross product of 2-D vectors, row by row."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def signed_area(loop: Points) -> float:
    """Area of a closed polygon (N, 2) in square metres; positive when it runs counter-clockwise."""
    return 0.5 * float(cross(loop, np.roll(loop, -1, axis=0)).sum())


def inside(loop: Points, point: Points) -> bool:
    """Even-odd test of one point against a closed polygon (N, 2)."""
    a, b = loop, np.roll(loop, -1, axis=0)
    over = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (point[1] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool((over & (at > point[0])).sum() % 2)


def find_crossing(line: Points, other: Points | None = None, is_open: bool = False) -> tuple[int, int] | None:
    """First pair of row numbers whose segments touch or cross, of two closed polylines or of one with itself; repeated
    points are left out. ``is_open``: ``line`` ends at its last point."""
    rows_a = _moving(line)
    rows_b = rows_a if other is None else _moving(other)
    a = line[rows_a]
    b = a if other is None else other[rows_b]
    a_end, b_end = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
    if is_open:
        a, a_end = a[:-1], a_end[:-1]
        if other is None:
            b, b_end = a, a_end
    b_low, b_high = np.minimum(b, b_end), np.maximum(b, b_end)
    count = len(a)
    numbers = np.arange(len(b))
    for start in range(0, count, _BLOCK):
        p, p_end = a[start : start + _BLOCK, None], a_end[start : start + _BLOCK, None]
        meet = (np.minimum(p, p_end) <= b_high).all(axis=2) & (np.maximum(p, p_end) >= b_low).all(axis=2)
        if other is None:
            mine = np.arange(start, start + len(p))[:, None]
            apart = (numbers - mine) % count
            meet &= (apart > 1) & (is_open | (apart < count - 1)) & (numbers > mine)
        i, j = np.nonzero(meet)
        if not len(i):
            continue
        p, p_end, q, q_end = a[start + i], a_end[start + i], b[j], b_end[j]
        sides_p = np.sign(cross(q_end - q, p - q)) * np.sign(cross(q_end - q, p_end - q))
        sides_q = np.sign(cross(p_end - p, q - p)) * np.sign(cross(p_end - p, q_end - p))
        hit = np.flatnonzero((sides_p <= 0) & (sides_q <= 0))
        if len(hit):
            return int(rows_a[start + i[hit[0]]]), int(rows_b[j[hit[0]]])
    return None


def _moving(line: Points) -> npt.NDArray[np.intp]:
    moved = np.linalg.norm(line - np.roll(line, 1, axis=0), axis=1) > 1e-6
    return np.flatnonzero(moved)


def _distinct(centre: Points) -> list[int]:
    """Rows at least DUPLICATE_M from the last kept one; at the end, from row 0 as well (the closing row)."""
    keep: list[int] = []
    x, y = centre[:, 0].tolist(), centre[:, 1].tolist()
    for row in range(len(centre)):
        if not keep or (x[row] - x[keep[-1]]) ** 2 + (y[row] - y[keep[-1]]) ** 2 >= DUPLICATE_M**2:
            keep.append(row)
    while len(keep) > 1 and (x[keep[-1]] - x[0]) ** 2 + (y[keep[-1]] - y[0]) ** 2 < DUPLICATE_M**2:
        keep.pop()
    return keep
