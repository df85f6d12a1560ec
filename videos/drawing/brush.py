"""Polygons, lines and discs with smooth edges at subpixel places on a picture, by OpenCV."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from .palette import Colour

_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
_ONE = 1 << _SHIFT
_FARTHEST_PX = 30_000.0  # OpenCV counts in 32 bits, 16 of them behind the point


def fixed(points: np.ndarray) -> np.ndarray:
    """Places in px as OpenCV's fixed-point numbers, within its range."""
    near = np.minimum(np.maximum(points, -_FARTHEST_PX), _FARTHEST_PX)  # np.clip takes three times as long
    return np.rint(near * _ONE).astype(np.int32)


def fill(picture: np.ndarray, outlines: Sequence[np.ndarray], colour: Colour) -> None:
    """Fill outlines (n, 2) in px; an outline within another is a hole."""
    if outlines:
        cv2.fillPoly(picture, [fixed(outline) for outline in outlines], colour, cv2.LINE_AA, _SHIFT)


def stroke(
    picture: np.ndarray, outlines: Sequence[np.ndarray], colour: Colour, width: float, closed: bool = True
) -> None:
    if outlines:
        lines = [fixed(outline) for outline in outlines]
        cv2.polylines(picture, lines, closed, colour, max(1, round(width)), cv2.LINE_AA, _SHIFT)


def disc(picture: np.ndarray, x: float, y: float, radius: float, colour: Colour, width: int = -1) -> None:
    """A disc, or with a ``width`` in px a ring."""
    (at,) = fixed(np.array([(x, y)])).tolist()
    cv2.circle(picture, at, max(1, round(radius * _ONE)), colour, width, cv2.LINE_AA, _SHIFT)


def rounded(width: float, height: float, radius: float, left: float = 0.0, top: float = 0.0) -> np.ndarray:
    """The outline of a rectangle with round corners, (n, 2)."""
    return _rounded(width, height, min(radius, width / 2, height / 2)) + np.array((left, top))


@lru_cache(maxsize=256)
def _rounded(width: float, height: float, radius: float) -> np.ndarray:
    turn = np.linspace(0.0, np.pi / 2, 9)
    arcs = []
    for number, (x, y) in enumerate(
        ((width - radius, height - radius), (radius, height - radius), (radius, radius), (width - radius, radius))
    ):
        angle = turn + number * np.pi / 2
        arcs.append(np.column_stack((x + radius * np.cos(angle), y + radius * np.sin(angle))))
    return np.concatenate(arcs)


class Sticker(NamedTuple):
    """A small picture with its coverage (uint8, (h, w)), for any ground and strength. ``corner``: px; only its four
    corners of this size are partly covered."""

    pixels: np.ndarray
    cover: np.ndarray
    corner: int

    @classmethod
    def card(cls, width: int, height: int, radius: float, colour: Colour, edge: Colour | None = None) -> Sticker:
        cover = np.zeros((height, width), np.uint8)
        outline = rounded(width, height, radius) - 0.5
        cv2.fillPoly(cover, [fixed(outline)], 255, cv2.LINE_AA, _SHIFT)
        corner = min(round(radius) + 2, width // 2, height // 2)
        cover[corner : height - corner] = 255
        cover[:, corner : width - corner] = 255
        pixels = np.empty((height, width, 3), np.uint8)
        pixels[:] = colour
        if edge is not None:
            stroke(pixels, [rounded(width - 1, height - 1, radius)], edge, 1)
        return cls(pixels, cover, corner)

    def put(self, picture: np.ndarray, left: int, top: int, strength: float = 1.0) -> None:
        """Lay it over the picture, clipped."""
        height, width = self.cover.shape
        x0, y0 = max(left, 0), max(top, 0)
        x1, y1 = min(left + width, picture.shape[1]), min(top + height, picture.shape[0])
        if x0 >= x1 or y0 >= y1 or strength <= 0.0:
            return
        whole = (x1 - x0, y1 - y0) == (width, height)
        if strength < 1.0 or not whole:
            rows, columns = slice(y0 - top, y1 - top), slice(x0 - left, x1 - left)
            _lay(picture[y0:y1, x0:x1], self.pixels[rows, columns], self.cover[rows, columns], min(strength, 1.0))
            return
        far_x, far_y, corner = width - self.corner, height - self.corner, self.corner
        under = picture[y0:y1, x0:x1]
        under[corner:far_y] = self.pixels[corner:far_y]
        for rows in (slice(0, corner), slice(far_y, height)):
            under[rows, corner:far_x] = self.pixels[rows, corner:far_x]
            for columns in (slice(0, corner), slice(far_x, width)):
                _lay(under[rows, columns], self.pixels[rows, columns], self.cover[rows, columns], 1.0)


def _lay(under: np.ndarray, pixels: np.ndarray, cover: np.ndarray, strength: float) -> None:
    share = cover[:, :, None].astype(np.float32) * (strength / 255.0)
    under[:] = np.rint(under + (pixels.astype(np.float32) - under) * share).astype(np.uint8)


def dim(picture: np.ndarray, outlines: Sequence[np.ndarray], share: float) -> None:
    """Paint a shadow with these outlines."""
    corners = np.concatenate(outlines)
    x0, y0 = np.maximum(np.floor(corners.min(axis=0)).astype(int) - 6, 0)
    x1, y1 = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 7, (picture.shape[1], picture.shape[0]))
    if x0 >= x1 or y0 >= y1:
        return
    cover = np.zeros((y1 - y0, x1 - x0), np.uint8)
    cv2.fillPoly(cover, [fixed(outline - (x0, y0)) for outline in outlines], round(255 * share), cv2.LINE_AA, _SHIFT)
    cover = 255 - cv2.blur(cover, (9, 9))
    under = picture[y0:y1, x0:x1]
    cv2.multiply(under, cv2.merge([cover] * 3), under, 1.0 / 255.0)
