"""Renders a frame: ground, walls and sky in perspective, then the solids in front of them."""

# Ground and sky are pictures of level planes that end at the walls of the hall. A ray that leaves the hall before it
# meets its plane shows the grey of the walls.

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from paddock.geometry.track import TrackGeometry

from ..solids import Solid
from .blocks import NEAR_M as NEAR_M
from .blocks import BlockPainter
from .optics import FRONT_CAMERA, Optics
from .texture import Bounds, Level, draw_ground
from .theme import OFFICIAL, Theme
from .warp import FRACTION, HALF_WEIGHT, Strip, Warp, best_warp

if TYPE_CHECKING:  # a camera needs no physics
    from ..car import Pose

_REDUCTIONS = (1, 2, 4)
_ONE = float(1 << FRACTION)
_FARTHEST_M = 1e6  # farther off there is only wall, and a line's numbers would become too large
_SKY_M = 0.1  # about a pixel of the sky


@dataclass(frozen=True)
class Scene:
    """The picture of an empty track: the ground's levels (finest first), the sky and the hall."""

    theme: Theme
    levels: tuple[Level, ...]
    sky: Level
    walls: Bounds

    @classmethod
    def of(cls, track: TrackGeometry, theme: Theme = OFFICIAL) -> Scene:
        """Draw the scene of a track; takes some ten milliseconds."""
        xmin, ymin, xmax, ymax = track.bounds
        margin = theme.field_margin
        hall = (xmin - margin, ymin - margin, xmax + margin, ymax + margin)
        across, up = (max(1, round(side / _SKY_M)) for side in (hall[2] - hall[0], hall[3] - hall[1]))
        sky = Level(np.full((up, across), theme.sky, np.uint8), hall)
        return cls(theme, draw_ground(track, theme, hall, _REDUCTIONS), sky, hall)


@dataclass(frozen=True)
class _Band:
    """Rows drawn from one picture. ``doublings``: each is the mean of 2^doublings rows that share its height, as far
    rows cover much ground."""

    first: int
    last: int  # one past
    level: Level
    level_m: float
    doublings: int

    @property
    def strip(self) -> Strip:
        return Strip(self.level.pixels, self.first, self.last, self.doublings)

    def terms(self, optics: Optics) -> np.ndarray:
        """(lines, 4, 4): the factors of a line's four numbers, see :meth:`.warp.Warp.aim`."""
        to_level, samples = self.level.from_ground(), 1 << self.doublings
        (across, _, column), (_, up, row) = (to_level[:2] * _ONE).tolist()
        column, row = column + HALF_WEIGHT, row + HALF_WEIGHT
        terms = []
        for number in range(self.strip.lines):
            ahead, left, step = optics.line_of_row(self.first + (number + 0.5) / samples - 0.5, self.level_m)
            terms.append(
                (
                    (across * ahead, -across * left, across, column),
                    (up * left, up * ahead, up, row),
                    (0.0, -across * step, 0.0, 0.0),
                    (up * step, 0.0, 0.0, 0.0),
                )
            )
        return np.array(terms).reshape(-1, 4, 4)


class Camera:
    """Draws the picture of a camera on the car, which neither rolls nor pitches, the same on every processor: in whole
    numbers along lines that are sums of products of doubles in a fixed order. ``warp``: by default the fastest."""

    def __init__(self, scene: Scene, optics: Optics = FRONT_CAMERA, warp: type[Warp] | None = None) -> None:
        bands = _bands(scene, optics)
        # (4 numbers of a line, lines) for each of the four terms
        terms = np.concatenate([band.terms(optics) for band in bands]).transpose(2, 1, 0)
        strips = [band.strip for band in bands]
        self._warp = (warp or best_warp())(strips, optics.columns, scene.theme.wall, terms)
        self._painter = BlockPainter(scene.theme, optics)

    def render(self, pose: Pose, solids: Sequence[Solid] = (), place: np.ndarray | None = None) -> np.ndarray:
        """The grey frame, uint8 (rows, columns): a fresh array, or ``place``, of any shape with as many pixels.
        ``solids`` hide each other and the ground by distance; a solid around the camera is invisible. Raises ValueError
        for a pose that is not finite."""
        x, y, yaw = pose.x, pose.y, pose.yaw
        if not math.isfinite(x + y + yaw):
            raise ValueError(f"the pose ({x}, {y}, {yaw}) is not finite")
        x_m, y_m = min(max(x, -_FARTHEST_M), _FARTHEST_M), min(max(y, -_FARTHEST_M), _FARTHEST_M)
        if place is not None and not solids:
            self._warp.see(math.cos(yaw), math.sin(yaw), x_m, y_m, place)
            return place
        self._warp.see(math.cos(yaw), math.sin(yaw), x_m, y_m)
        frame = self._warp.frame.copy() if place is None else self._warp.frame
        if solids:
            self._painter.paint(frame, x, y, yaw, solids)
        if place is None:
            return frame
        place[...] = frame.reshape(place.shape)
        return place

    def drawing_in(self, place: np.ndarray) -> tuple[int, int] | None:
        """The addresses with which C draws the ground alone in ``place`` (``paddock_see`` of warp.c); None where it
        cannot."""
        return self._warp.drawing_in(place)


def _bands(scene: Scene, optics: Optics) -> list[_Band]:
    fine, middle, coarse = scene.levels
    scale = optics.rows / 120
    first = math.floor(optics.horizon) + 1  # the first row of ground, perhaps outside of the frame
    horizon, far, near = (
        min(max(row, 0), optics.rows) for row in (first, first + round(10 * scale), first + round(26 * scale))
    )
    return [
        _Band(0, horizon, scene.sky, scene.theme.wall_height, 0),
        _Band(horizon, far, coarse, 0.0, 2),
        _Band(far, near, middle, 0.0, 1),
        _Band(near, optics.rows, fine, 0.0, 0),
    ]
