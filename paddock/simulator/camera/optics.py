"""Where a camera sits on the car and how it maps level ground to pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

FAR_M = 10_000.0  # no hall is as large


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

    def line_of_row(self, row: float, level_m: float = 0.0) -> tuple[float, float, float]:
        """Where a row of pixels meets a level plane, in the car's frame: as the camera does not roll, on a straight
        line across. Metres ahead, metres to the left in the first column, and more metres to the left a column.

        ``row`` may lie between two. ``level_m``: of another plane above the ground; one below the camera is seen under
        the horizon, one above it over the horizon. Rays that meet the plane at ``FAR_M`` or later, or never, are said
        to meet it there.
        """
        # A ray goes right by a = (column - centre) / focal and down by this for one unit along the axis.
        down = (row - (self.rows - 1) / 2) / self.focal
        cos, sin = math.cos(self.pitch), math.sin(self.pitch)
        above, fall = self.height - level_m, sin + cos * down
        units = min(above / fall, FAR_M) if above * fall > 0.0 else FAR_M
        step = -units / self.focal
        return self.x + units * (cos - sin * down), self.y - step * (self.columns - 1) / 2, step


FRONT_CAMERA = Optics()

# deepracer-simapp: the pair of the stereo car sits 0.03 m to each side of where the single camera would be, and
# LEFT_CAMERA is the left one of it.
STEREO_LEFT = replace(FRONT_CAMERA, y=0.03)
STEREO_RIGHT = replace(FRONT_CAMERA, y=-0.03)
