"""Pictures of what a car's sensors see: real readings at three places of a track. No Django, and no physics."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import cv2
import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.packages.inputs import CAMERAS, lidar_settings
from paddock.simulator import lidar
from paddock.simulator.camera.view import Scene
from paddock.simulator.sensors import lidar_layout, make_sensors
from paddock.simulator.solids import Solid, box, car

if TYPE_CHECKING:
    from paddock.simulator.car import Car

ZOOM = 2  # a pixel of a camera is so many here
FAN_PX = 240  # side of a lidar's square, as high as a camera's frame
GAP_PX = 8

_PAPER, _GRID, _THING, _BEAM, _HIT = 24, 56, 110, 150, 255
_RADIUS = FAN_PX / 2 - 8
_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
_LENGTH, _WIDTH = 0.324, 0.188  # m, of the car in the middle of a fan


class Viewpoint(NamedTuple):
    """A place from which to look: where the car's base is (m, rad), and what is around it."""

    x: float
    y: float
    yaw: float
    solids: tuple[Solid, ...]


class _Looker(NamedTuple):
    pose: Viewpoint


def sensor_picture(
    track: TrackGeometry, sensors: Sequence[str], lidar_config: Mapping[str, float] | None = None
) -> bytes:
    """A grey PNG of three rows, one for each of :func:`views`: the camera's frame (of a stereo pair the left one, then
    the right one), and the lidar's reading as a fan seen from above, the car's nose up.

    LIDAR is a line for each beam; SECTOR_LIDAR fills the sectors that are on; DISCRETIZED_SECTOR_LIDAR fills the step
    of each sector's nearest thing. Boxes and cars are outlined. Deterministic. Raises ValueError for an unknown sensor.
    """
    scene = Scene.of(track)
    config = lidar_settings(lidar_config)
    readings = make_sensors(sensors, lambda: scene, config)
    rows = []
    for view in views(track):
        shown = {name: read(cast("Car", _Looker(view)), view.solids) for name, read in readings.items()}
        rows.append(_row(shown, view, config))
    return png_of(_joined(rows, axis=0), 9)


def reading_picture(
    readings: Mapping[str, np.ndarray], view: Viewpoint, lidar_config: Mapping[str, float] | None = None
) -> bytes:
    """One row of such a picture: what sensors read at ``view``, as a grey PNG. Raises ValueError for a sensor that is
    not here."""
    return png_of(_row(readings, view, lidar_settings(lidar_config)), 6)


def frame_strip(cars: Sequence[Sequence[np.ndarray]]) -> bytes:
    """Frames of cameras as one grey PNG without gaps: a row for each car, its frames from left to right."""
    rows = [np.concatenate([frame[:, :, 0] for frame in frames], axis=1) for frames in cars]
    return png_of(np.concatenate(rows, axis=0), 6)


def _row(readings: Mapping[str, np.ndarray], view: Viewpoint, config: Mapping[str, float]) -> np.ndarray:
    panels: list[np.ndarray] = []
    for name in sorted(readings, key=lambda name: name not in CAMERAS):
        panels += _frames(readings[name]) if name in CAMERAS else [_fan(name, readings[name], view, config)]
    return _joined(panels, axis=1)


def png_of(pixels: np.ndarray, compression: int) -> bytes:
    """The pixels as a PNG."""
    written, png = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    if not written:
        raise RuntimeError("OpenCV wrote no PNG")
    return png.tobytes()


_NEXT_BOX_M = 1.0
_IN_SIGHT = math.radians(20)  # of the front camera's 30 to either side


def views(track: TrackGeometry) -> tuple[Viewpoint, ...]:
    """Three places: where the track is straightest, with a box ahead and one beside; where it bends most with the next
    box still in sight; and in traffic, a car ahead and one behind."""
    steps = np.linspace(0.0, track.length, 200, endpoint=False).tolist()
    bends = [
        abs(math.remainder(track.point_at(metres + 1.5)[2] - track.point_at(metres)[2], math.tau)) for metres in steps
    ]

    def in_sight(metres: float) -> bool:
        x, y, heading = track.lane_centre(metres, "inner")
        box_x, box_y, _ = track.lane_centre(metres + _NEXT_BOX_M, "outer")
        return abs(math.remainder(math.atan2(box_y - y, box_x - x) - heading, math.tau)) < _IN_SIGHT

    straight = steps[int(np.argmin(bends))]
    bend = max(zip(bends, steps, strict=True), key=lambda place: (in_sight(place[1]), place[0]))[1]

    def lane(make: Callable[..., Solid], metres: float, side: str) -> Solid:
        return make(*track.lane_centre(metres, side))

    return (
        Viewpoint(
            *track.lane_centre(straight, "outer"), (lane(box, straight + 1.1, "outer"), lane(box, straight, "inner"))
        ),
        Viewpoint(
            *track.lane_centre(bend, "inner"), (lane(box, bend + _NEXT_BOX_M, "outer"), lane(box, bend + 2.2, "inner"))
        ),
        Viewpoint(*track.point_at(straight), (lane(car, straight + 0.8, "inner"), lane(car, straight - 0.5, "outer"))),
    )


def _joined(panels: Sequence[np.ndarray], axis: int) -> np.ndarray:
    """Panels side by side (axis 1) or one below the other (axis 0), a gap between them."""
    shape = (panels[0].shape[0], GAP_PX) if axis == 1 else (GAP_PX, panels[0].shape[1])
    gap = np.full(shape, _PAPER, np.uint8)
    parts = [part for panel in panels for part in (gap, panel)][1:]
    return np.concatenate(parts, axis=axis)


def _frames(reading: np.ndarray) -> list[np.ndarray]:
    larger = reading.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1)
    return [larger[:, :, channel] for channel in range(larger.shape[2])]


class _LidarCanvas:
    """A square seen from above: metres from the lidar, x to the front (up), y to the left."""

    def __init__(self, reach_m: float) -> None:
        self.pixels = np.full((FAN_PX, FAN_PX), _PAPER, np.uint8)
        self._scale = _RADIUS / reach_m

    def _at(self, x: float, y: float) -> tuple[int, int]:
        middle = (FAN_PX - 1) / 2
        across, down = (
            round(min(max(value, -1000.0), 1000.0) * (1 << _SHIFT))
            for value in (middle - y * self._scale, middle - x * self._scale)
        )
        return across, down

    def line(self, start: tuple[float, float], end: tuple[float, float], grey: int) -> None:
        cv2.line(self.pixels, self._at(*start), self._at(*end), grey, 1, cv2.LINE_AA, _SHIFT)

    def dot(self, x: float, y: float, grey: int) -> None:
        cv2.circle(self.pixels, self._at(x, y), 2 << _SHIFT, grey, -1, cv2.LINE_AA, _SHIFT)

    def ring(self, radius_m: float, grey: int) -> None:
        cv2.circle(self.pixels, self._at(0, 0), round(radius_m * self._scale * (1 << _SHIFT)), grey, 1, cv2.LINE_AA, 4)

    def polygon(self, points: Sequence[tuple[float, float]], grey: int, filled: bool = False) -> None:
        corners = np.array([self._at(*point) for point in points], np.int32)
        if filled:
            cv2.fillPoly(self.pixels, [corners], grey, cv2.LINE_AA, _SHIFT)
        else:
            cv2.polylines(self.pixels, [corners], True, grey, 1, cv2.LINE_AA, _SHIFT)


def _fan(name: str, reading: np.ndarray, view: Viewpoint, config: Mapping[str, float]) -> np.ndarray:
    reach, sectors, steps = lidar_layout(name, config)
    canvas = _LidarCanvas(reach)
    if name == "LIDAR":
        _beams(canvas, reading, reach)
    else:
        _cells(canvas, reading.reshape(sectors, steps), reach)
    for outline in _outlines(view):
        canvas.polygon(outline, _THING)
    canvas.ring(reach, _GRID)
    return canvas.pixels


def _beams(canvas: _LidarCanvas, reading: np.ndarray, reach: float) -> None:
    for bearing, metres in zip(lidar.BEAM_DEG, reading.tolist(), strict=True):
        end = _polar(metres, bearing)
        canvas.line((0.0, 0.0), end, _BEAM if metres < reach else _GRID)
        if metres < reach:
            canvas.dot(*end, _HIT)


def _cells(canvas: _LidarCanvas, groups: np.ndarray, reach: float) -> None:
    """The sectors as pieces of a pie, each cut into its steps; those that are on are filled."""
    step_m, width = reach / groups.shape[1], lidar.BEAMS // groups.shape[0]
    half = (lidar.LAST_DEG - lidar.FIRST_DEG) / (lidar.BEAMS - 1) / 2  # a beam stands for so much to each side
    for sector, values in enumerate(groups):
        first = lidar.BEAM_DEG[sector * width] - half
        turn = np.linspace(first, first + 2 * half * width, 2 + width).tolist()
        for step, value in enumerate(values):
            outer = [_polar((step + 1) * step_m, bearing) for bearing in turn]
            inner = [_polar(step * step_m, bearing) for bearing in reversed(turn)]
            if value:
                canvas.polygon(outer + inner, _HIT, filled=True)
            canvas.polygon(outer + inner, _GRID)


def _polar(metres: float, bearing_deg: float) -> tuple[float, float]:
    angle = math.radians(bearing_deg)
    return metres * math.cos(angle), metres * math.sin(angle)


def _outlines(view: Viewpoint) -> list[list[tuple[float, float]]]:
    """Corners of the car itself and of the solids about it, as its lidar sees them."""
    own = [(x - lidar.MOUNT_X, y) for x, y in _corners(0.0, 0.0, 0.0, _LENGTH / 2, _WIDTH / 2)]
    cos, sin = math.cos(view.yaw), math.sin(view.yaw)
    outlines = [own]
    for solid in view.solids:
        corners = _corners(solid.x - view.x, solid.y - view.y, solid.yaw, solid.half_length, solid.half_width)
        outlines.append([(x * cos + y * sin - lidar.MOUNT_X, y * cos - x * sin) for x, y in corners])
    return outlines


def _corners(x: float, y: float, yaw: float, length: float, width: float) -> list[tuple[float, float]]:
    """Corners of a rectangle, ``length`` and ``width`` from its middle."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return [
        (x + along * cos - across * sin, y + along * sin + across * cos)
        for along, across in ((length, width), (length, -width), (-length, -width), (-length, width))
    ]
