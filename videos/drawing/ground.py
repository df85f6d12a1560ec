"""The track on the ground as polygons, of which only those near the picture's middle are filled."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from paddock.geometry.track import TrackGeometry

from . import palette
from .palette import Colour

CELL_M = 3.0
DASH_M, GAP_M, DASH_HALF_M = 0.25, 0.25, 0.009
CHECK_M = 0.06  # side of a square of the finish line
KERB_M, STONE_M = 0.065, 0.12
_BEND = 0.45  # 1/m: where the track bends more than this, its inner side has a kerb
_SMOOTH_M = 0.5
_KEPT_CELLS = 64
_ROUNDED_M, _BETWEEN = 0.03, 4
_LEAST_STONES = 5


class Patch(NamedTuple):
    """One fill: the corners of all its outlines in metres, (n, 2), the slice of each outline, and the colour. An
    outline within another is a hole."""

    corners: np.ndarray
    parts: list[slice]
    colour: Colour

    @classmethod
    def of(cls, outlines: list[np.ndarray], colour: Colour) -> Patch:
        ends = np.cumsum([len(outline) for outline in outlines]).tolist()
        parts = [slice(end - len(outline), end) for outline, end in zip(outlines, ends, strict=True)]
        return cls(np.concatenate(outlines), parts, colour)


class GroundPaint(NamedTuple):
    """Colours of the ground; half the width of a border's line and the width of the verge, m. ``dark``, ``light``: of
    the finish line."""

    verge: Colour = palette.VERGE
    road: Colour = palette.ROAD
    line: Colour = palette.ROAD_LINE
    dash: Colour = palette.ROAD_LINE
    kerb_red: Colour = palette.KERB_RED
    kerb_white: Colour = palette.KERB_WHITE
    dark: Colour = palette.SUNKEN
    light: Colour = palette.TEXT
    border_m: float = 0.011
    verge_m: float = 0.16


PLAIN_PAINT = GroundPaint()


class Ground:
    """The patches of a track, from below to above, cut into cells that are kept."""

    def __init__(self, track: TrackGeometry, reach_m: float, paint: GroundPaint = PLAIN_PAINT) -> None:
        """``reach_m``: the visible distance from the picture's middle."""
        self._reach, self._paint = reach_m, paint
        *holes, around = outlines = [rounded_off(line) for line in track.outlines]
        ring = Polygon(around, holes).buffer(0)
        self._road, self._verge = ring, ring.buffer(paint.verge_m, quad_segs=4)
        borders = [LineString(np.vstack((line, line[:1]))) for line in outlines]
        self._borders = shapely.union_all([line.buffer(paint.border_m, quad_segs=3) for line in borders])
        shapely.prepare(self._borders)
        red, white = _kerbs(track, paint.border_m)
        self._kerbs = (_Pieces(red, paint.kerb_red), _Pieces(white, paint.kerb_white))
        dark, light = _finish(track)
        self._dashes = _Pieces(_dashes(track), paint.dash)
        self._finish = (_Pieces(dark, paint.dark), _Pieces(light, paint.light))
        self._cells: OrderedDict[tuple[int, int], list[Patch]] = OrderedDict()

    def around(self, x: float, y: float) -> list[Patch]:
        """The patches within reach of the point, in the order of painting."""
        cell = (math.floor(x / CELL_M), math.floor(y / CELL_M))
        patches = self._cells.get(cell)
        if patches is None:
            patches = self._cells[cell] = list(self._cut(cell))
            if len(self._cells) > _KEPT_CELLS:
                self._cells.popitem(last=False)
        return patches

    def _cut(self, cell: tuple[int, int]) -> Iterator[Patch]:
        box = (
            cell[0] * CELL_M - self._reach,
            cell[1] * CELL_M - self._reach,
            (cell[0] + 1) * CELL_M + self._reach,
            (cell[1] + 1) * CELL_M + self._reach,
        )
        road = shapely.clip_by_rect(self._road, *box)
        yield from _patch(shapely.clip_by_rect(self._verge, *box), self._paint.verge)
        for pieces in self._kerbs:
            yield from pieces.within(box)
        yield from _patch(road, self._paint.road)
        yield from self._dashes.within(box)
        yield from _patch(shapely.clip_by_rect(self._borders, *box), self._paint.line)
        for pieces in self._finish:
            yield from pieces.within(box)


class _Pieces:
    """Many small polygons of one colour."""

    def __init__(self, pieces: list[np.ndarray], colour: Colour) -> None:
        self._pieces, self._colour = pieces, colour
        self._low = np.array([piece.min(axis=0) for piece in pieces]).reshape(-1, 2)
        self._high = np.array([piece.max(axis=0) for piece in pieces]).reshape(-1, 2)

    def within(self, box: tuple[float, float, float, float]) -> Iterator[Patch]:
        seen = (self._low < box[2:]).all(axis=1) & (self._high > box[:2]).all(axis=1)
        found = [self._pieces[index] for index in np.flatnonzero(seen)]
        if found:
            yield Patch.of(found, self._colour)


def rounded_off(line: np.ndarray) -> np.ndarray:
    """A closed border (n, 2) with more points, on a curve through all of its own (Catmull and Rom). Where the curve
    leaves the border by more than ``_ROUNDED_M`` the border stays straight."""
    before, start, end, after = (np.roll(line, shift, axis=0) for shift in (1, 0, -1, -2))
    share = np.linspace(0.0, 1.0, _BETWEEN + 1)[:-1, None, None]
    straight = start + share * (end - start)
    curve = 0.5 * (
        2.0 * start
        + share * (end - before)
        + share**2 * (2.0 * before - 5.0 * start + 4.0 * end - after)
        + share**3 * (3.0 * start - before - 3.0 * end + after)
    )
    apart = np.linalg.norm(curve - straight, axis=2).max(axis=0)
    points = np.where((apart <= _ROUNDED_M)[None, :, None], curve, straight)
    return points.transpose(1, 0, 2).reshape(-1, 2)


def _patch(shape: BaseGeometry, colour: Colour) -> Iterator[Patch]:
    outlines = [
        np.array(ring.coords)[:-1, :2]
        for polygon in shapely.get_parts(shape)
        if isinstance(polygon, Polygon) and not polygon.is_empty
        for ring in (polygon.exterior, *polygon.interiors)
    ]
    if outlines:
        yield Patch.of(outlines, colour)


def _dashes(track: TrackGeometry) -> list[np.ndarray]:
    first, last = track.paved
    count = max(1, round((last - first) / (DASH_M + GAP_M)))
    starts = first + np.arange(count) * ((last - first) / count)
    along = np.linspace(0.0, DASH_M, 4)
    return [
        np.concatenate(
            (track.points_at(start + along, DASH_HALF_M), track.points_at(start + along[::-1], -DASH_HALF_M))
        )
        for start in starts
    ]


def _finish(track: TrackGeometry) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The dark and the light squares of the finish line."""
    finish = track.finish_m
    left, right = track.half_widths_at(finish)
    columns = max(2, round((left + right) / CHECK_M))
    edges = np.linspace(-right, left, columns + 1)
    squares: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    for row in (-1, 0):
        near, far = row * CHECK_M, (row + 1) * CHECK_M
        for column in range(columns):
            low, high = edges[column], edges[column + 1]
            distances = finish + np.array((near, far, far, near))
            corners = track.points_at(distances, np.array((low, low, high, high)))
            squares[(row + column) % 2].append(corners)
    return squares


def _kerbs(track: TrackGeometry, border_m: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Red and white stones along the inner side of every bend; the simulator has none."""
    count = max(8, round(track.length / STONE_M))
    step = track.length / count
    distances = np.arange(count) * step
    reach = _SMOOTH_M / 2
    before, after = track.points_at(distances - reach), track.points_at(distances + reach)
    middle = track.points_at(distances)
    first, second = middle - before, after - middle
    turn = np.arctan2(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0], (first * second).sum(axis=1))
    bend = turn / reach
    left, right = track.half_widths_along(distances)
    edges = np.where(bend > 0, left, right)
    # inside a bend that is tighter than the road is wide, stones would overlap
    wanted = (np.abs(bend) > _BEND) & (np.abs(bend) < 1.0 / (edges + KERB_M + 0.12))
    side = np.where(wanted, np.sign(bend), 0.0)
    stones: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    for run in np.split(np.arange(count), np.flatnonzero(np.diff(side)) + 1):
        if side[run[0]] == 0.0 or len(run) < _LEAST_STONES:
            continue
        for number, index in enumerate(run.tolist()):
            ends = np.array((index, index + 1)) * step
            inner, outer = side[index] * (edges[index] - border_m), side[index] * (edges[index] + KERB_M)
            corners = np.concatenate((track.points_at(ends, inner), track.points_at(ends[::-1], outer)))
            stones[number % 2].append(corners)
    return stones
