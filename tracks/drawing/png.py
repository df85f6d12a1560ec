"""A track map as PNG, for previews where no style sheet reaches: link cards, e-mail, the command line. No Django."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from paddock.geometry.checks import Points
from paddock.geometry.track import TrackGeometry

from .marks import BoxMark, box_corners
from .svg import BOX_MARKS, MARGIN_M, arrow, finish_line, mark_size, start_line
from .trajectories import Trajectory

MIN_SIDE_PX, MAX_SIDE_PX = 16, 2048
DASH_M, GAP_M = 0.25, 0.25

_OVERSAMPLE = 3


@dataclass(frozen=True)
class Scheme:
    """Colours of a map."""

    ground: str
    road: str
    border: str
    centre: str
    mark: str
    line: str
    box: str
    box_line: str
    speeds: tuple[str, str, str, str, str, str]


_SPEEDS_DARK = ("#e5484d", "#f2803a", "#f2c53d", "#9ccc3c", "#2fbf71", "#2cc9dd")
_SPEEDS_LIGHT = ("#cf222e", "#c2560c", "#b08800", "#5f8f17", "#1a7f45", "#0b7f95")
SCHEMES = {
    "dark": Scheme(
        "#161b22", "#2b313b", "#586069", "#a1a9b4", "#ff3b55", "#34d17f", "#d99a3d", "#5e3d0c", _SPEEDS_DARK
    ),
    "light": Scheme(
        "#ffffff", "#dfe3e8", "#a8b0ba", "#68717d", "#d81e3a", "#1a8f53", "#c98a2b", "#7a4f10", _SPEEDS_LIGHT
    ),
}


def draw_png(
    track: TrackGeometry,
    size: tuple[int, int] = (640, 360),
    *,
    scheme: str = "dark",
    trajectory: Sequence[Sequence[float]] | None = None,
    lines: Sequence[Trajectory] = (),
    boxes: Sequence[BoxMark] = (),
    car: tuple[float, float] | None = None,
) -> bytes:
    """The map of :func:`draw_svg` as PNG bytes, boxes without their numbers. ``size``: (width, height) in pixels;
    ``scheme``: dark or light.

    Raises ValueError for another scheme or a side outside 16..2048 px.
    """
    if scheme not in SCHEMES:
        raise ValueError(f"scheme must be one of {sorted(SCHEMES)}, not {scheme!r}")
    if not all(MIN_SIDE_PX <= side <= MAX_SIDE_PX for side in size):
        raise ValueError(f"each side must be {MIN_SIDE_PX} to {MAX_SIDE_PX} px, not {size}")
    colours = SCHEMES[scheme]
    if trajectory is not None:
        lines = (*lines, Trajectory(trajectory))
    canvas = _Canvas(track, size, colours.ground)
    *holes, around = track.outlines
    canvas.loop(around, colours.road)
    for hole in holes:
        canvas.loop(hole, colours.ground)
    for border in track.outlines:
        canvas.stroke(np.vstack((border, border[:1])), colours.border, 1.2)
    for dash in _dashes(track):
        canvas.stroke(dash, colours.centre, 1.0)
    for one in lines:
        for speed, points in one.strokes():
            canvas.stroke(points, colours.line if speed is None else colours.speeds[speed], 2.2)
    if track.is_open:
        canvas.stroke(start_line(track), colours.centre, 2.0)
    canvas.stroke(finish_line(track), colours.mark, 2.6)
    canvas.stroke(arrow(track), colours.mark, 2.2)
    for box in boxes:
        canvas.block(box_corners(box, BOX_MARKS * mark_size(track)), colours.box, colours.box_line)
    if car is not None and math.isfinite(car[0]) and math.isfinite(car[1]):
        canvas.dot(car, 0.8 * mark_size(track), colours.mark)
    return canvas.png()


class _Canvas:
    """A picture drawn in metres, several times too large and then shrunk, which smooths every edge."""

    def __init__(self, track: TrackGeometry, size: tuple[int, int], ground: str) -> None:
        self._size = size
        width, height = size[0] * _OVERSAMPLE, size[1] * _OVERSAMPLE
        x_min, y_min, x_max, y_max = track.bounds
        self._scale = min(width / (x_max - x_min + 2 * MARGIN_M), height / (y_max - y_min + 2 * MARGIN_M))
        self._x = width / 2 - self._scale * (x_min + x_max) / 2
        self._y = height / 2 + self._scale * (y_min + y_max) / 2
        # Strokes are given for a preview of usual size and shrink with a smaller one.
        self._pen = _OVERSAMPLE * min(1.0, max(0.5, min(size) / 240))
        self._image = Image.new("RGB", (width, height), ground)
        self._draw = ImageDraw.Draw(self._image)

    def loop(self, points: Points, colour: str) -> None:
        self._draw.polygon(self._places(points), fill=colour)

    def stroke(self, points: Sequence[Sequence[float]] | Points, colour: str, width: float) -> None:
        places = self._places(points)
        pen = max(1, round(width * self._pen))
        self._draw.line(places, fill=colour, width=pen, joint="curve")
        for x, y in (places[0], places[-1]):  # round ends
            half = pen / 2
            self._draw.ellipse((x - half, y - half, x + half, y + half), fill=colour)

    def block(self, corners: Sequence[tuple[float, float]], colour: str, edge: str) -> None:
        self._draw.polygon(self._places(corners), fill=colour, outline=edge, width=max(1, round(self._pen)))

    def dot(self, point: Sequence[float], radius_m: float, colour: str) -> None:
        (x, y), r = self._places([point])[0], radius_m * self._scale
        self._draw.ellipse((x - r, y - r, x + r, y + r), fill=colour)

    def png(self) -> bytes:
        stream = io.BytesIO()
        self._image.resize(self._size, Image.Resampling.LANCZOS).save(stream, "PNG", optimize=True)
        return stream.getvalue()

    def _places(self, points: Sequence[Sequence[float]] | Points) -> list[tuple[float, float]]:
        return [(self._x + self._scale * float(p[0]), self._y - self._scale * float(p[1])) for p in points]


def _dashes(track: TrackGeometry) -> list[list[tuple[float, float]]]:
    count = max(1, round(track.length / (DASH_M + GAP_M)))
    step = track.length / count
    return [[track.point_at(k * step + DASH_M * share / 2)[:2] for share in range(3)] for k in range(count)]
