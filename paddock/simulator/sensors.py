"""What a car may carry, and how a reading is laid out in memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from paddock.packages.inputs import SENSOR_NAMES, input_spec, lidar_settings

from . import lidar
from .camera.optics import FRONT_CAMERA, STEREO_LEFT, STEREO_RIGHT
from .camera.view import Camera, Scene
from .solids import Solid

if TYPE_CHECKING:  # sensors need no physics
    from .action import ActionSpace
    from .car import Car

SENSORS = SENSOR_NAMES

# For scripted drivers only, never offered to a model: base x, y (m), yaw (rad), speed (m/s).
POSE = "POSE"


class Reading(Protocol):
    """A car and all that it can see besides the track, to an array: a fresh one, or ``place``, which is only written
    to."""

    def __call__(self, car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray: ...


@dataclass(frozen=True)
class SensorSpec:
    """Shape and type of one sensor's reading: cameras are (rows, columns, channels) of uint8, lidars a row of
    float32."""

    name: str
    shape: tuple[int, ...]
    dtype: str
    low: float = 0.0
    high: float = 255.0

    @property
    def nbytes(self) -> int:
        """Bytes of one reading."""
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize


def sensor_spec(name: str, lidar_config: Mapping[str, float] | None = None) -> SensorSpec:
    """The spec of a sensor; ``lidar_config`` counts for DISCRETIZED_SECTOR_LIDAR only, with the field's own defaults.

    Raises ValueError for a sensor that this simulator does not have.
    """
    if name not in SENSORS:
        raise ValueError(f"no sensor {name!r} here; there are {', '.join(sorted(SENSORS))}")
    spec = input_spec(name, lidar_config)
    if spec.is_picture:
        return SensorSpec(name, spec.shape, "uint8")
    low, high = (lidar.LEAST_M, lidar.RAW_LIMIT_M) if name == "LIDAR" else (0.0, 1.0)
    return SensorSpec(name, spec.shape, "float32", low, high)


def policy_header(metadata: Mapping[str, Any], space: ActionSpace) -> dict[str, Any]:
    """What a policy must take and answer, see :mod:`paddock.network.policy_wire`."""
    specs = [sensor_spec(name, metadata.get("lidar_config")) for name in sorted(metadata["sensor"])]
    inputs = [{"name": spec.name, "dtype": spec.dtype, "shape": list(spec.shape)} for spec in specs]
    header = {"inputs": inputs, "outputs": space.size, "ranges": space.ranges}
    frames = metadata.get("frame_stack", 1)
    return header if frames == 1 else {**header, "frames": frames}


# LEFT_CAMERA is the front camera under another name (deepracer-simapp, sensors/sensors_rollout.py): only a car with a
# stereo pair carries its left camera to the left.
_CAMERAS = {name: FRONT_CAMERA for name in ("FRONT_FACING_CAMERA", "LEFT_CAMERA", "observation")}


def make_sensors(
    names: Sequence[str], scene: Callable[[], Scene], lidar_config: Mapping[str, float] | None = None
) -> dict[str, Reading]:
    """A reading function for each sensor name, in sorted order. ``scene`` is only drawn when a sensor needs it.

    The functions keep nothing from one reading to the next: cars may share them. Raises ValueError for a sensor that
    this simulator does not have; uploads with such a model are refused before it comes here.
    """
    readings: dict[str, Reading] = {}
    for name in sorted(set(names)):
        if name == POSE:
            readings[name] = _read_pose
            continue
        sensor_spec(name)
        if name == "STEREO_CAMERAS":
            readings[name] = _stereo_reading(Camera(scene(), STEREO_LEFT), Camera(scene(), STEREO_RIGHT))
        elif name in ("LIDAR", "SECTOR_LIDAR", "DISCRETIZED_SECTOR_LIDAR"):
            readings[name] = _lidar_reading(name, scene().walls, lidar_settings(lidar_config))
        else:
            readings[name] = _camera_reading(Camera(scene(), _CAMERAS[name]))
    return readings


def _camera_reading(camera: Camera) -> Reading:
    def read(car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray:
        if place is None:
            return camera.render(car.pose, solids)[:, :, None]
        camera.render(car.pose, solids, place)
        return place

    return read


def _stereo_reading(left: Camera, right: Camera) -> Reading:
    def read(car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray:
        pose = car.pose
        return np.stack((left.render(pose, solids), right.render(pose, solids)), axis=2, out=place)

    return read


def _lidar_reading(name: str, hall: lidar.Hall, config: Mapping[str, float]) -> Reading:
    reach, encode = _encoding(name, config)

    def read(car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray:
        return _placed(encode(lidar.scan(car.pose, solids, hall, reach)), place)

    return read


def _encoding(name: str, config: Mapping[str, float]) -> tuple[float, Callable[[np.ndarray], np.ndarray]]:
    """How far a lidar sensor has to look, in metres, and what becomes of the scan."""
    if name == "LIDAR":
        return lidar.RAW_LIMIT_M, lidar.raw
    if name == "SECTOR_LIDAR":
        return lidar.SECTOR_LIMIT_M, lidar.sectors
    sectors, values, limit = int(config["num_sectors"]), int(config["num_values_per_sector"]), config["clipping_dist"]
    return limit, lambda distances: lidar.discretized(distances, sectors, values, limit)


def _read_pose(car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray:
    return _placed(np.array((*car.pose, car.speed)), place)


def _placed(reading: np.ndarray, place: np.ndarray | None) -> np.ndarray:
    if place is None:
        return reading
    np.copyto(place, reading, casting="no")
    return place
