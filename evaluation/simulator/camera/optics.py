"""Where a camera sits on the car and how it maps level ground to pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Optics:
    """A pinhole camera on the car. Metres and radians; x forward and y left from the car's base.

    Defaults: the front camera of deepracer-simapp, 640x480 pixels seen at a quarter. Its mount
    (urdf/deepracer/deepracer_single_cam.urdf) is 0.1453 m ahead, 0.1303 m high and pitched 0.2618 rad in the body's
    frame; but the body's rear axle is 0.0390 m up and its front axle 0.0350 m, on wheels of one size (0.036 m), so the
    body stands 0.0243 rad nose up. The frames of that camera (dr-demo-1..3) show the same: with the pitch below, their
    walls come out at the mesh's 1.0 m.
    """

    x: float = 0.1421
    y: float = 0.0
    height: float = 0.1328
    pitch: float = 0.2375  # down
    horizontal_fov: float = 1.13
    columns: int = 160
    rows: int = 120

    @property
    def focal(self) -> float:
        """Focal length in pixels of the small picture."""
        return self.columns / 2 / math.tan(self.horizontal_fov / 2)

    @property
    def horizon(self) -> float:
        """Row (pixel centres are whole numbers) of the horizon."""
        return (self.rows - 1) / 2 - self.focal * math.tan(self.pitch)

    def ground_from_pixels(self, level_m: float = 0.0) -> np.ndarray:
        """(3, 3): homogeneous (column, row, 1) to homogeneous ground (x, y, 1) in the car's frame.

        ``level_m``: of another level plane above the ground. One below the camera is seen under the horizon, one above
        it over the horizon.
        """
        focal, cos, sin = self.focal, math.cos(self.pitch), math.sin(self.pitch)
        centre_u, centre_v = (self.columns - 1) / 2, (self.rows - 1) / 2
        # A ray goes right by a = (u - cu)/f and down by b = (v - cv)/f for one unit along the axis.
        right = np.array([1.0, 0.0, -centre_u]) / focal
        down = np.array([0.0, 1.0, -centre_v]) / focal
        one = np.array([0.0, 0.0, 1.0])
        fall = sin * one + cos * down  # how far the ray falls: it meets the plane after above / fall
        above = self.height - level_m
        forward = above * (cos * one - sin * down) + self.x * fall
        left = -above * right + self.y * fall
        return np.array([forward, left, fall])


FRONT_CAMERA = Optics()

# deepracer-simapp: the pair of the stereo car sits 0.03 m to each side of where the single camera would be, and
# LEFT_CAMERA is the left one of it.
STEREO_LEFT = replace(FRONT_CAMERA, y=0.03)
STEREO_RIGHT = replace(FRONT_CAMERA, y=-0.03)
