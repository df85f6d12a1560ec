"""The picture: ground, walls and sky by perspective warps, then the solids that stand before them.

Ground and sky are pictures of level planes that end at the walls of the hall, and outside of them lies the walls' grey:
a wall is where a ray leaves the hall before it meets the plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import cv2
import numpy as np

from tracks.geometry import TrackGeometry

from ..solids import Solid
from .blocks import NEAR_M as NEAR_M
from .blocks import BlockPainter
from .optics import FRONT_CAMERA, Optics
from .texture import Bounds, Level, draw_ground
from .theme import OFFICIAL, Theme

if TYPE_CHECKING:  # a camera needs no physics
    from ..car import Pose

_REDUCTIONS = (1, 2, 4)
_WARP = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
_SKY_M = 0.1  # a pixel of the sky, about: its edge is smooth


@dataclass(frozen=True)
class Scene:
    """All that a camera can see of an empty track: the ground's levels (finest first), the sky and the hall."""

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
    """Rows drawn from one picture. ``doublings``: far rows cover much ground lengthwise, and one sample of it would
    sparkle; so 2^doublings rows are drawn for each and averaged in pairs."""

    first: int
    last: int  # one past
    level: Level
    level_m: float
    doublings: int

    @property
    def samples(self) -> int:
        return 1 << self.doublings

    def terms(self, optics: Optics) -> np.ndarray:
        """(5, 9): the homography from pixels of the band's own picture to pixels of its level is the sum of these,
        times (cosine and sine of the car's heading, its x, its y, 1)."""
        # Row r of the band's own picture is row first + (r + 0.5) / samples - 0.5 of the frame.
        rows = np.array([[1, 0, 0], [0, 1 / self.samples, self.first + 0.5 / self.samples - 0.5], [0, 0, 1]])
        forward, left, one = optics.ground_from_pixels(self.level_m) @ rows
        none = np.zeros(3)
        ground = np.array(
            [
                [forward, left, none],
                [-left, forward, none],
                [one, none, none],
                [none, one, none],
                [none, none, one],
            ]
        )
        return (self.level.from_ground() @ ground).reshape(5, 9)


class Camera:
    """Draws what a camera on the car sees. The car does not roll or pitch: it has no suspension."""

    def __init__(self, scene: Scene, optics: Optics = FRONT_CAMERA) -> None:
        self._wall = scene.theme.wall
        self._frame = np.empty((optics.rows, optics.columns), np.uint8)
        bands = _bands(scene, optics)
        self._terms = np.hstack([band.terms(optics) for band in bands])
        self._place = np.ones(5)
        self._homographies = np.empty(self._terms.shape[1])
        matrices = self._homographies.reshape(-1, 3, 3)
        self._bands = [self._prepared(band, matrix) for band, matrix in zip(bands, matrices, strict=True)]
        self._painter = BlockPainter(scene.theme, optics)

    def _prepared(self, band: _Band, homography: np.ndarray) -> tuple:
        """(the first arguments of the band's warp, halvings): all that is not made anew for each frame. A halving: even
        rows, odd rows, buffer for their mean."""
        rows, columns = band.last - band.first, self._frame.shape[1]
        buffers = [np.empty((rows << n, columns), np.uint8) for n in range(band.doublings, 0, -1)]
        buffers.append(self._frame[band.first : band.last])
        halvings = [(full[::2], full[1::2], half) for full, half in pairwise(buffers)]
        return (band.level.pixels, homography, (columns, rows * band.samples), buffers[0]), halvings

    def render(self, pose: Pose, solids: Sequence[Solid] = ()) -> np.ndarray:
        """The grey frame, uint8 (rows, columns), a fresh array. ``solids`` hide each other and the ground by distance;
        one that the camera is inside of is not seen, as its faces look outwards."""
        x, y, yaw = pose.x, pose.y, pose.yaw  # of anything that has them, as pictures of sensors do
        place, wall = self._place, self._wall
        place[0], place[1], place[2], place[3] = math.cos(yaw), math.sin(yaw), x, y
        np.matmul(place, self._terms, self._homographies)
        for (pixels, homography, size, picture), halvings in self._bands:
            cv2.warpPerspective(pixels, homography, size, picture, _WARP, cv2.BORDER_CONSTANT, wall)
            for even, odd, half in halvings:
                cv2.addWeighted(even, 0.5, odd, 0.5, 0.0, half)
        frame = self._frame.copy()
        if solids:
            self._painter.paint(frame, x, y, yaw, solids)
        return frame


def _bands(scene: Scene, optics: Optics) -> list[_Band]:
    fine, middle, coarse = scene.levels
    horizon = math.floor(optics.horizon) + 1  # first row that shows ground
    scale = optics.rows / 120
    far, near = horizon + round(10 * scale), horizon + round(26 * scale)
    return [
        _Band(0, horizon, scene.sky, scene.theme.wall_height, 0),
        _Band(horizon, far, coarse, 0.0, 2),
        _Band(far, near, middle, 0.0, 1),
        _Band(near, optics.rows, fine, 0.0, 0),
    ]
