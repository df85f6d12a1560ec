"""Draws the ground of a track as a picture."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from paddock.geometry.markings import dashes_of, line_across
from paddock.geometry.track import TrackGeometry

from .theme import Theme

Bounds = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax

FINE_M = 0.005  # metres a pixel, about: a dash is 5 pixels wide
MAX_PIXELS = 20_000_000  # of the finest level; a larger hall gets larger pixels
# Pixels by which OpenCV's smooth drawings are too large on each side.
_BLEED_OF_LINES, _BLEED_OF_AREAS = 1.2, 0.7
_SHIFT = 6  # fractional bits of OpenCV's drawing coordinates


@dataclass(frozen=True)
class Level:
    """One resolution of a level plane. ``pixels``: uint8 (rows, columns); row 0 is the lowest y; they fill ``bounds``
    (metres) exactly."""

    pixels: np.ndarray
    bounds: Bounds

    def from_ground(self) -> np.ndarray:
        """(3, 3): (x, y, 1) in metres to (column, row, 1) with pixel centres at whole numbers."""
        xmin, ymin, xmax, ymax = self.bounds
        rows, columns = self.pixels.shape
        across, up = columns / (xmax - xmin), rows / (ymax - ymin)
        return np.array([[across, 0.0, -xmin * across - 0.5], [0.0, up, -ymin * up - 0.5], [0.0, 0.0, 1.0]])


def draw_ground(track: TrackGeometry, theme: Theme, hall: Bounds, reductions: tuple[int, ...]) -> tuple[Level, ...]:
    """The hall's ground in one level for each reduction, the first of which is 1."""
    xmin, ymin, xmax, ymax = hall
    width, height = xmax - xmin, ymax - ymin
    metres = max(FINE_M, math.sqrt(width * height / MAX_PIXELS))
    coarsest = max(reductions)
    columns, rows = (int(np.ceil(side / metres / coarsest)) * coarsest for side in (width, height))
    per_metre = np.array((columns / width, rows / height))

    def fixed(points: np.ndarray) -> np.ndarray:
        pixels = (points - (xmin, ymin)) * per_metre - 0.5
        return np.round(pixels * (1 << _SHIFT)).astype(np.int32)

    spare = _BLEED_OF_AREAS / per_metre.mean()
    borders = [fixed(line) for line in track.outlines]
    ground = np.full((rows, columns), theme.field, np.uint8)
    cv2.fillPoly(ground, borders, theme.road, cv2.LINE_AA, _SHIFT)
    for dash in fixed(dashes_of(track, theme, spare)):
        cv2.fillConvexPoly(ground, dash, theme.dash, cv2.LINE_AA, _SHIFT)
    # Twice as thick as the line; the half outside the road is covered by the field again.
    thickness = max(1, round(2 * (theme.line_width * per_metre.mean() - _BLEED_OF_LINES)))
    cv2.polylines(ground, borders, True, theme.line, thickness, cv2.LINE_AA, _SHIFT)
    *holes, around = (
        fixed(_beyond(border, middle, spare)) for border, middle in zip(track.outlines, track.middles, strict=True)
    )
    frame = np.array([(-9, -9), (columns + 9, -9), (columns + 9, rows + 9), (-9, rows + 9)], np.int32) << _SHIFT
    cv2.fillPoly(ground, [frame, around], theme.field, cv2.LINE_AA, _SHIFT)
    for hole in holes:
        cv2.fillPoly(ground, [hole], theme.field, cv2.LINE_AA, _SHIFT)
    if track.is_open:
        for metres in (0.0, track.finish_m):
            line = line_across(track, metres, theme.line_width, spare)
            cv2.fillConvexPoly(ground, fixed(line), theme.line, cv2.LINE_AA, _SHIFT)
    sizes = [(columns // reduction, rows // reduction) for reduction in reductions[1:]]
    pictures = [ground, *(cv2.resize(ground, size, interpolation=cv2.INTER_AREA) for size in sizes)]
    return tuple(Level(picture, hall) for picture in pictures)


def _beyond(border: np.ndarray, centre: np.ndarray, metres: float) -> np.ndarray:
    """A border moved off the road, across it."""
    across = border - centre
    return border + across * (metres / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9))
