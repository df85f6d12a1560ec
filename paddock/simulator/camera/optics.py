"""The position of a camera on the car, and its mapping from level ground to pixels."""

import math
from dataclasses import dataclass, replace

FAR_M = 10_000.0  # no hall is as large


@dataclass(frozen=True)
class Optics:
    """A pinhole camera on the car. Metres and radians; x forward and y left from the car's base.

    Defaults: the front camera of deepracer-simapp, 640x480 pixels at a quarter. Its mount
    (urdf/deepracer/deepracer_single_cam.urdf) is 0.1453 m ahead, 0.1303 m high and pitched 0.2618 rad in the frame of
    the body, which stands 0.0243 rad nose up (axles at 0.0390 and 0.0350 m on equal wheels).
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
        """The straight line where a row of pixels meets a level plane, in the car's frame: metres ahead, metres to the
        left in the first column, and more metres to the left a column.

        ``row`` may lie between two. ``level_m``: height of the plane. Rays that meet it at ``FAR_M`` or later, or
        never, count as meeting it there.
        """
        # down for one unit along the axis
        down = (row - (self.rows - 1) / 2) / self.focal
        cos, sin = math.cos(self.pitch), math.sin(self.pitch)
        above, fall = self.height - level_m, sin + cos * down
        units = min(above / fall, FAR_M) if above * fall > 0.0 else FAR_M
        step = -units / self.focal
        return self.x + units * (cos - sin * down), self.y - step * (self.columns - 1) / 2, step


FRONT_CAMERA = Optics()

# deepracer-simapp: the stereo pair sits 0.03 m to each side of the single camera's place.
STEREO_LEFT = replace(FRONT_CAMERA, y=0.03)
STEREO_RIGHT = replace(FRONT_CAMERA, y=-0.03)
