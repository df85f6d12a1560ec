"""Upright blocks in a picture: boxes and cars, the nearer over the farther."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter

import cv2
import numpy as np

from ..solids import CAR, Solid
from .optics import Optics
from .theme import Theme

NEAR_M = 0.02  # deepracer-simapp: near plane of the camera
_CLOSE_M = 0.1  # a block with a part nearer than this is drawn the careful way
_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
_BLEED = 0.7 * (1 << _SHIFT)  # OpenCV's smooth polygons are too large by so much on each side
_LIMIT = 30_000 << _SHIFT  # OpenCV counts pixels in 16 bits
_DETAIL_M = 2.0  # a car's windows and wheels are drawn up to here: farther off they are a pixel or two

# Corners of a block, front left first, in halves of its length and width; face k lies between corners k - 1 and k.
_CORNERS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
_FRONT, _LEFT, _BACK, _RIGHT = range(4)

# Rectangles on a car's face in shares of its length (from the left, as it is seen) and of its height.
_Patch = tuple[float, float, float, float]
_WINDOW: _Patch = (0.12, 0.88, 0.58, 0.88)
_WHEELS: tuple[_Patch, ...] = ((0.06, 0.30, 0.0, 0.34), (0.70, 0.94, 0.0, 0.34))

_Edge = tuple[float, float]  # forward and left of the eye, metres: an upright edge of a block
_Seen = tuple[float, float, float]  # depth along the axis, right, down, metres
# Columns and rows, in fixed-point pixels, of a face's corners: low left, low right, high right, high left.
_Face = tuple[float, float, float, float, float, float, float, float]


class BlockPainter:
    """Draws solids by one camera."""

    def __init__(self, theme: Theme, optics: Optics) -> None:
        self._theme = theme
        self._eye = (optics.x, optics.y)
        self._height = optics.height
        self._cos, self._sin = math.cos(optics.pitch), math.sin(optics.pitch)
        self._focal = optics.focal * (1 << _SHIFT)
        self._centre = ((optics.columns - 1) / 2 * (1 << _SHIFT), (optics.rows - 1) / 2 * (1 << _SHIFT))
        self._spread = math.tan(optics.horizontal_fov / 2)  # half of the seen width for each metre of depth
        self._points = np.empty((4, 2), np.int32)
        self._flat = self._points.reshape(-1)

    def paint(self, frame: np.ndarray, x: float, y: float, yaw: float, solids: Sequence[Solid]) -> None:
        """Draw ``solids`` into the picture of a car at (x, y) with this heading."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        ahead, aside = self._eye
        eye_x, eye_y = x + ahead * cos - aside * sin, y + ahead * sin + aside * cos
        spread, lower = self._spread, self._height
        seen = []
        for solid in solids:
            dx, dy = solid[0] - eye_x, solid[1] - eye_y
            reach = solid[3] + solid[4]
            forward = dx * cos + dy * sin
            if forward + reach < 0.0:
                continue  # behind
            left = dy * cos - dx * sin
            # What lies low is a little deeper than it is far ahead.
            if abs(left) - reach > spread * (forward + reach + lower):
                continue  # beyond the sides of the picture
            found = _from_outside(solid, forward, left, solid[2] - yaw)
            if found is not None:
                seen.append(found)
        if len(seen) > 1:  # blocks that stand apart hide each other in the order of their nearest points
            seen.sort(key=itemgetter(0), reverse=True)
        for square, solid, first, edges in seen:
            self._paint_one(frame, solid, first, edges, square < _DETAIL_M * _DETAIL_M)

    def _paint_one(self, frame: np.ndarray, solid: Solid, first: int, edges: list[_Edge], near: bool) -> None:
        is_car = solid[6] == CAR
        greys = self._theme.car if is_car else self._theme.box
        cos, sin, focal = self._cos, self._sin, self._focal
        centre_u, centre_v = self._centre
        low, high = -self._height, solid[5] - self._height
        low_deep, low_fall, high_deep, high_fall = low * sin, low * cos, high * sin, high * cos
        lows, highs = [], []
        for forward, left in edges:
            deep, fall = forward * cos, forward * sin
            low_depth, high_depth = deep - low_deep, deep - high_deep
            if low_depth < _CLOSE_M or high_depth < _CLOSE_M:
                self._paint_close(frame, solid, first, edges)
                return
            scale = focal / low_depth
            lows.append((centre_u - left * scale, centre_v - (fall + low_fall) * scale - _BLEED))
            scale = focal / high_depth
            highs.append((centre_u - left * scale, centre_v - (fall + high_fall) * scale + _BLEED))
        # The outline is drawn inwards by what smooth polygons are too large; the second face covers the first.
        (a, b), (c, d) = lows[0], highs[0]
        lows[0], highs[0] = (a + _BLEED, b), (c + _BLEED, d)
        (a, b), (c, d) = lows[-1], highs[-1]
        lows[-1], highs[-1] = (a - _BLEED, b), (c - _BLEED, d)
        for number in range(len(lows) - 1):
            face = (*lows[number], *lows[number + 1], *highs[number + 1], *highs[number])
            self._fill(frame, face, greys[(first + number) % 4])
            if is_car and near:
                self._fill(frame, _part(face, _WINDOW), self._theme.car_window)
                if (first + number) % 2:
                    for wheel in _WHEELS:
                        self._fill(frame, _part(face, wheel), self._theme.car_wheel)

    def _paint_close(self, frame: np.ndarray, solid: Solid, first: int, edges: list[_Edge]) -> None:
        """Draw a block that touches the camera or reaches behind it, its faces cut at the near plane."""
        greys = self._theme.car if solid[6] == CAR else self._theme.box
        cos, sin, focal = self._cos, self._sin, self._focal
        centre_u, centre_v = self._centre
        low, high = -self._height, solid[5] - self._height
        for number in range(len(edges) - 1):
            (af, al), (bf, bl) = edges[number], edges[number + 1]
            corners = [
                (forward * cos - up * sin, -left, -forward * sin - up * cos)
                for forward, left, up in ((af, al, low), (bf, bl, low), (bf, bl, high), (af, al, high))
            ]
            points = [
                (_bounded(centre_u + right * focal / depth), _bounded(centre_v + down * focal / depth))
                for depth, right, down in _clip(corners)
            ]
            if points:
                grey = greys[(first + number) % 4]
                cv2.fillConvexPoly(frame, np.array(points, np.int32), grey, cv2.LINE_AA, _SHIFT)

    def _fill(self, frame: np.ndarray, face: _Face, grey: int) -> None:
        self._flat[:] = face
        cv2.fillConvexPoly(frame, self._points, grey, cv2.LINE_AA, _SHIFT)


def _from_outside(
    solid: Solid, forward: float, left: float, turn: float
) -> tuple[float, Solid, int, list[_Edge]] | None:
    """What is seen of a block ``forward`` and ``left`` of the eye, turned by ``turn`` to the left; None from within.

    (square of the distance to its nearest point, the block, the first face that is seen, the upright edges of the
    seen faces as (forward, left)). Faces and edges come from the left of the picture to its right.
    """
    cos, sin = math.cos(turn), math.sin(turn)
    length, width = solid[3], solid[4]
    ahead, aside = -forward * cos - left * sin, forward * sin - left * cos  # the eye in the block's own frame
    beyond, beside = abs(ahead) - length, abs(aside) - width
    end, side = (_FRONT if ahead > 0.0 else _BACK), (_LEFT if aside > 0.0 else _RIGHT)
    if beyond > 0.0:
        if beside > 0.0:
            square = beyond * beyond + beside * beside
            first, last = (end, side) if (side - end) % 4 == 1 else (side, end)
        else:
            square, first, last = beyond * beyond, end, end
    elif beside > 0.0:
        square, first, last = beside * beside, side, side
    else:
        return None
    along_x, along_y, across_x, across_y = length * cos, length * sin, -width * sin, width * cos
    corners = (first - 1, first, last) if first != last else (first - 1, first)
    edges = []
    for corner in corners:
        a, b = _CORNERS[corner]
        edges.append((forward + a * along_x + b * across_x, left + a * along_y + b * across_y))
    return square, solid, first, edges


def _part(face: _Face, patch: _Patch) -> _Face:
    """A part of a face; evenly on the picture, which is near enough for a window."""
    alx, aly, blx, bly, bhx, bhy, ahx, ahy = face
    left, right, bottom, top = patch

    def at(along: float, up: float) -> tuple[float, float]:
        low_x, low_y = alx + along * (blx - alx), aly + along * (bly - aly)
        high_x, high_y = ahx + along * (bhx - ahx), ahy + along * (bhy - ahy)
        return low_x + up * (high_x - low_x), low_y + up * (high_y - low_y)

    return (*at(left, bottom), *at(right, bottom), *at(right, top), *at(left, top))


def _bounded(pixels: float) -> float:
    return min(max(pixels, -_LIMIT), _LIMIT)


def _clip(corners: Sequence[_Seen]) -> list[_Seen]:
    """The part of a polygon before the near plane (Sutherland and Hodgman)."""
    kept = []
    for index, corner in enumerate(corners):
        before = corners[index - 1]
        if (corner[0] >= NEAR_M) != (before[0] >= NEAR_M):
            share = (NEAR_M - before[0]) / (corner[0] - before[0])
            kept.append(
                (
                    NEAR_M,
                    before[1] + share * (corner[1] - before[1]),
                    before[2] + share * (corner[2] - before[2]),
                )
            )
        if corner[0] >= NEAR_M:
            kept.append(corner)
    return kept
