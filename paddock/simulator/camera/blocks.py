"""Draws upright blocks (boxes and cars) into a picture, the nearer over the farther."""

import math
from collections.abc import Sequence
from operator import itemgetter

import cv2
import numpy as np

from ..solids import CAR, Solid
from .optics import Optics
from .theme import Theme

NEAR_M = 0.02  # deepracer-simapp: near plane of the camera
_CLOSE_M = 0.1  # a block with a part nearer than this is clipped
_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
_BLEED = 0.7 * (1 << _SHIFT)  # OpenCV's smooth polygons are too large by so much on each side
_LIMIT = 30_000 << _SHIFT  # OpenCV counts pixels in 16 bits
_DETAIL_M = 2.0  # a car's windows and wheels are drawn up to this distance

# Corners of a block are counted from the front left one; face k lies between corners k - 1 and k.
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
    """Draws solids in the picture of one camera. Arithmetic is written out for speed."""

    def __init__(self, theme: Theme, optics: Optics) -> None:
        self._theme = theme
        self._eye = (optics.x, optics.y)
        self._height = optics.height
        self._cos, self._sin = math.cos(optics.pitch), math.sin(optics.pitch)
        self._focal = optics.focal * (1 << _SHIFT)
        self._centre = ((optics.columns - 1) / 2 * (1 << _SHIFT), (optics.rows - 1) / 2 * (1 << _SHIFT))
        self._spread = math.tan(optics.horizontal_fov / 2)  # half of the seen width for each metre of depth

    def paint(self, frame: np.ndarray, x: float, y: float, yaw: float, solids: Sequence[Solid]) -> None:
        """Draw ``solids`` into the picture of a car at (x, y) with this heading."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        ahead, aside = self._eye
        eye_x, eye_y = x + ahead * cos - aside * sin, y + ahead * sin + aside * cos
        spread, lower = self._spread, self._height
        seen = []
        for solid in solids:
            at_x, at_y, heading, length, width, _, _ = solid
            dx, dy = at_x - eye_x, at_y - eye_y
            reach = length + width
            forward = dx * cos + dy * sin
            if forward + reach < 0.0:
                continue  # behind
            left = dy * cos - dx * sin
            # low points are a little deeper than they are far ahead
            if abs(left) - reach > spread * (forward + reach + lower):
                continue  # beyond the sides of the picture
            found = _from_outside(solid, forward, left, heading - yaw)
            if found is not None:
                seen.append(found)
        if len(seen) > 1:  # separate blocks hide each other in the order of their nearest points
            seen.sort(key=itemgetter(0), reverse=True)
        faces: list[float] = []
        greys: list[int] = []
        for square, solid, first, edges in seen:
            if not self._add(faces, greys, solid, first, edges, square < _DETAIL_M * _DETAIL_M):
                _fill(frame, faces, greys)
                faces, greys = [], []
                self._paint_close(frame, solid, first, edges)
        _fill(frame, faces, greys)

    def _add(
        self, faces: list[float], greys: list[int], solid: Solid, first: int, edges: tuple[_Edge, ...], near: bool
    ) -> bool:
        """Add the faces of a block (see ``_Face``) and their greys in drawing order. False, and nothing is added, for a
        block so close that it must be clipped at the near plane."""
        cos, sin, focal = self._cos, self._sin, self._focal
        centre_u, centre_v = self._centre
        low, high = -self._height, solid[5] - self._height
        low_deep, low_fall, high_deep, high_fall = low * sin, low * cos, high * sin, high * cos
        corners: list[float] = []
        for forward, left in edges:
            deep, fall = forward * cos, forward * sin
            low_depth, high_depth = deep - low_deep, deep - high_deep
            if low_depth < _CLOSE_M or high_depth < _CLOSE_M:
                return False
            low_scale, high_scale = focal / low_depth, focal / high_depth
            corners += (
                centre_u - left * low_scale,
                centre_v - (fall + low_fall) * low_scale - _BLEED,
                centre_u - left * high_scale,
                centre_v - (fall + high_fall) * high_scale + _BLEED,
            )
        # the outline is shrunk by the bleed; the second face covers the first
        corners[0] += _BLEED
        corners[2] += _BLEED
        corners[-4] -= _BLEED
        corners[-2] -= _BLEED
        if solid[6] == CAR:
            shades = self._theme.car
            for number in range(len(edges) - 1):
                side = (first + number) % 4
                alx, aly, ahx, ahy, blx, bly, bhx, bhy = corners[4 * number : 4 * number + 8]
                face = (alx, aly, blx, bly, bhx, bhy, ahx, ahy)
                faces += face
                greys.append(shades[side])
                if near:
                    faces += _part(face, _WINDOW)
                    greys.append(self._theme.car_window)
                    if side % 2:
                        for wheel in _WHEELS:
                            faces += _part(face, wheel)
                            greys.append(self._theme.car_wheel)
            return True
        shades = self._theme.box
        alx, aly, ahx, ahy, blx, bly, bhx, bhy, *rest = corners
        faces += (alx, aly, blx, bly, bhx, bhy, ahx, ahy)
        greys.append(shades[first])
        if rest:
            clx, cly, chx, chy = rest
            faces += (blx, bly, clx, cly, chx, chy, bhx, bhy)
            greys.append(shades[(first + 1) % 4])
        return True

    def _paint_close(self, frame: np.ndarray, solid: Solid, first: int, edges: tuple[_Edge, ...]) -> None:
        """Draw a block that touches the camera or reaches behind it, its faces clipped at the near plane."""
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


def _fill(frame: np.ndarray, faces: list[float], greys: list[int]) -> None:
    """Draw faces one after the other; ``faces`` has eight numbers for each of them."""
    if greys:
        points = np.array(faces).astype(np.int32).reshape(-1, 4, 2)
        for corners, grey in zip(points, greys, strict=True):
            cv2.fillConvexPoly(frame, corners, grey, cv2.LINE_AA, _SHIFT)


def _from_outside(
    solid: Solid, forward: float, left: float, turn: float
) -> tuple[float, Solid, int, tuple[_Edge, ...]] | None:
    """The visible part of a block ``forward`` and ``left`` of the eye, turned by ``turn`` to the left, or None from
    within: (square of the distance to its nearest point, the block, the first visible face, the upright edges of the
    visible faces as (forward, left)), faces and edges from the left of the picture to its right."""
    cos, sin = math.cos(turn), math.sin(turn)
    length, width = solid[3], solid[4]
    ahead, aside = -forward * cos - left * sin, forward * sin - left * cos  # the eye in the block's own frame
    beyond, beside = abs(ahead) - length, abs(aside) - width
    if beyond > 0.0:
        end = _FRONT if ahead > 0.0 else _BACK
        if beside > 0.0:
            square = beyond * beyond + beside * beside
            side = _LEFT if aside > 0.0 else _RIGHT
            first, last = (end, side) if (side - end) % 4 == 1 else (side, end)
        else:
            square, first, last = beyond * beyond, end, end
    elif beside > 0.0:
        first = last = _LEFT if aside > 0.0 else _RIGHT
        square = beside * beside
    else:
        return None
    along_x, along_y, across_x, across_y = length * cos, length * sin, -width * sin, width * cos
    front_x, front_y, back_x, back_y = forward + along_x, left + along_y, forward - along_x, left - along_y
    corners = (
        (front_x + across_x, front_y + across_y),
        (back_x + across_x, back_y + across_y),
        (back_x - across_x, back_y - across_y),
        (front_x - across_x, front_y - across_y),
    )
    if first == last:
        return square, solid, first, (corners[first - 1], corners[first])
    return square, solid, first, (corners[first - 1], corners[first], corners[last])


def _part(face: _Face, patch: _Patch) -> _Face:
    """A part of a face, interpolated in the picture."""
    alx, aly, blx, bly, bhx, bhy, ahx, ahy = face
    left, right, bottom, top = patch
    wide_x, wide_y, high_x, high_y = blx - alx, bly - aly, bhx - ahx, bhy - ahy
    lx, ly, hx, hy = alx + left * wide_x, aly + left * wide_y, ahx + left * high_x, ahy + left * high_y
    rx, ry, sx, sy = alx + right * wide_x, aly + right * wide_y, ahx + right * high_x, ahy + right * high_y
    hx, hy, sx, sy = hx - lx, hy - ly, sx - rx, sy - ry
    return (
        *(lx + bottom * hx, ly + bottom * hy, rx + bottom * sx, ry + bottom * sy),
        *(rx + top * sx, ry + top * sy, lx + top * hx, ly + top * hy),
    )


def _bounded(pixels: float) -> float:
    return min(max(pixels, -_LIMIT), _LIMIT)


def _clip(corners: Sequence[_Seen]) -> list[_Seen]:
    """The part of a polygon before the near plane (Sutherland and Hodgman)."""
    kept = []
    for index, corner in enumerate(corners):
        before = corners[index - 1]
        if (corner[0] >= NEAR_M) != (before[0] >= NEAR_M):
            share = (NEAR_M - before[0]) / (corner[0] - before[0])
            right, down = (before[axis] + share * (corner[axis] - before[axis]) for axis in (1, 2))
            kept.append((NEAR_M, right, down))
        if corner[0] >= NEAR_M:
            kept.append(corner)
    return kept
