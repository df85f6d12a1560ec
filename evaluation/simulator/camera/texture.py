"""The ground of a track as a picture, drawn once."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracks.geometry import TrackGeometry

from .theme import Theme

FINE_M = 0.0025  # metres a pixel: a dash is 10 pixels wide
MAX_PIXELS = 40_000_000  # of the finest level; a larger track gets larger pixels
_BLEED = 1.2  # pixels by which OpenCV's smooth thick lines are too wide on each side
_SHIFT = 6  # fractional bits of OpenCV's drawing coordinates


@dataclass(frozen=True)
class Level:
    """One resolution of the ground. ``pixels``: uint8 (rows, columns); row 0 is the lowest y."""

    pixels: np.ndarray
    metres: float  # a pixel
    x0: float  # corner of pixel (0, 0)
    y0: float

    def from_car(self, x: float, y: float, cos: float, sin: float) -> np.ndarray:
        """(3, 3): (forward, left, 1) in metres from a car at (x, y), its heading given by cosine and sine, to
        (column, row, 1) with pixel centres at whole numbers."""
        scale = 1.0 / self.metres
        cos, sin = cos * scale, sin * scale
        column, row = (x - self.x0) * scale - 0.5, (y - self.y0) * scale - 0.5
        return np.array([[cos, -sin, column], [sin, cos, row], [0.0, 0.0, 1.0]])


def draw_ground(track: TrackGeometry, theme: Theme, reductions: tuple[int, ...] = (1, 4, 8)) -> tuple[Level, ...]:
    """The ground under the borders' bounding box in one level for each reduction; all around it lies the field."""
    xmin, ymin, xmax, ymax = track.bounds
    margin = 0.1
    width, height = xmax - xmin + 2 * margin, ymax - ymin + 2 * margin
    metres = max(FINE_M, (width * height / MAX_PIXELS) ** 0.5)
    coarsest = max(reductions)
    columns, rows = (int(np.ceil(side / metres / coarsest)) * coarsest for side in (width, height))
    x0, y0 = xmin - margin, ymin - margin

    def fixed(points: np.ndarray) -> np.ndarray:
        pixels = (points - (x0, y0)) / metres - 0.5
        return np.round(pixels * (1 << _SHIFT)).astype(np.int32)

    borders = [fixed(track.inner), fixed(track.outer)]
    ground = np.full((rows, columns), theme.field, np.uint8)
    cv2.fillPoly(ground, borders, theme.road, cv2.LINE_AA, _SHIFT)
    for dash in _dashes(track, theme):
        cv2.fillConvexPoly(ground, fixed(dash), theme.dash, cv2.LINE_AA, _SHIFT)
    # Twice as thick as the line; the half outside the road is covered by the field again.
    thickness = max(1, round(2 * (theme.line_width / metres - _BLEED)))
    cv2.polylines(ground, borders, True, theme.line, thickness, cv2.LINE_AA, _SHIFT)
    inner, outer = borders
    frame = np.array([(-9, -9), (columns + 9, -9), (columns + 9, rows + 9), (-9, rows + 9)], np.int32) << _SHIFT
    cv2.fillPoly(ground, [frame, outer], theme.field, cv2.LINE_AA, _SHIFT)
    cv2.fillPoly(ground, [inner], theme.field, cv2.LINE_AA, _SHIFT)
    return tuple(
        Level(
            ground
            if reduction == 1
            else cv2.resize(ground, (columns // reduction, rows // reduction), interpolation=cv2.INTER_AREA),
            metres * reduction,
            x0,
            y0,
        )
        for reduction in reductions
    )


def _dashes(track: TrackGeometry, theme: Theme) -> list[np.ndarray]:
    """Corners (4, 2) of each dash of the centre line; the first starts at the finish, the pitch fits the length."""
    count = max(1, round(track.length / theme.dash_pitch))
    pitch, half = track.length / count, theme.dash_width / 2
    return [
        np.array(
            [
                track.point_at(distance, side)[:2]
                for distance, side in (
                    (start, half),
                    (start + theme.dash_length, half),
                    (start + theme.dash_length, -half),
                    (start, -half),
                )
            ]
        )
        for start in (number * pitch for number in range(count))
    ]
