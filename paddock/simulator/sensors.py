"""The sensors of a car, and the memory layout of their readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from paddock.network.policy_wire import PolicyHeader, PolicyInput
from paddock.packages.inputs import IN_STEPS, LIDARS, SENSOR_NAMES, input_spec, lidar_settings

from . import lidar
from .camera.optics import FRONT_CAMERA, STEREO_LEFT, STEREO_RIGHT
from .camera.view import Camera, Scene
from .solids import Solid

if TYPE_CHECKING:  # sensors need no physics
    from .action import ActionSpace
    from .car import Car

SENSORS = SENSOR_NAMES

# For scripted drivers only: base x, y (m), yaw (rad), speed (m/s).
POSE = "POSE"


class Reading(Protocol):
    """A function from a car and the blocks around it to an array: a fresh one, or ``place``."""

    def __call__(self, car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray: ...


@dataclass(frozen=True)
class SensorSpec:
    """Shape and type of a reading: cameras (rows, columns, channels) of uint8, lidars a row of float32."""

    name: str
    shape: tuple[int, ...]
    dtype: str
    low: float = 0.0
    high: float = 255.0


def sensor_spec(name: str, lidar_config: Mapping[str, float] | None = None) -> SensorSpec:
    """The spec of a sensor; ``lidar_config``: of DISCRETIZED_SECTOR_LIDAR. Raises ValueError for an unknown sensor."""
    if name not in SENSORS:
        raise ValueError(f"no sensor {name!r} here; there are {', '.join(sorted(SENSORS))}")
    spec = input_spec(name, lidar_config)
    if spec.is_picture:
        return SensorSpec(name, spec.shape, "uint8")
    low, high = (lidar.LEAST_M, lidar.RAW_LIMIT_M) if name == "LIDAR" else (0.0, 1.0)
    return SensorSpec(name, spec.shape, "float32", low, high)


def policy_header(metadata: Mapping[str, Any], space: ActionSpace) -> PolicyHeader:
    """The inputs and outputs of a policy, see :mod:`paddock.network.policy_wire`."""
    specs = [sensor_spec(name, metadata.get("lidar_config")) for name in sorted(metadata["sensor"])]
    inputs: list[PolicyInput] = [{"name": spec.name, "dtype": spec.dtype, "shape": list(spec.shape)} for spec in specs]
    header: PolicyHeader = {"inputs": inputs, "outputs": space.size, "ranges": space.ranges}
    frames = metadata.get("frame_stack", 1)
    return header if frames == 1 else {**header, "frames": frames}


# LEFT_CAMERA is the front camera under another name (deepracer-simapp, sensors/sensors_rollout.py).
_CAMERAS = {name: FRONT_CAMERA for name in ("FRONT_FACING_CAMERA", "LEFT_CAMERA", "observation")}


def make_sensors(
    names: Sequence[str], scene: Callable[[], Scene], lidar_config: Mapping[str, float] | None = None
) -> dict[str, Reading]:
    """A reading function for each sensor name, in sorted order, which cars may share. ``scene``: drawn when a sensor
    needs it. Raises ValueError for an unknown sensor."""
    readings: dict[str, Reading] = {}
    for name in sorted(set(names)):
        if name == POSE:
            readings[name] = _read_pose
            continue
        sensor_spec(name)
        if name == "STEREO_CAMERAS":
            readings[name] = _stereo_reading(Camera(scene(), STEREO_LEFT), Camera(scene(), STEREO_RIGHT))
        elif name in LIDARS:
            readings[name] = _lidar_reading(name, scene().walls, lidar_settings(lidar_config))
        else:
            readings[name] = CameraReading(Camera(scene(), _CAMERAS[name]))
    return readings


@dataclass(frozen=True)
class CameraReading:
    """Reads a camera."""

    camera: Camera

    def __call__(self, car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray:
        if place is None:
            return self.camera.render(car.pose, solids)[:, :, None]
        self.camera.render(car.pose, solids, place)
        return place


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
    """The range of a lidar sensor in metres and the encoding of its scan."""
    reach, sectors, values = lidar_layout(name, config)
    if name == "LIDAR":
        return reach, lidar.raw
    if name == "SECTOR_LIDAR":
        return reach, lidar.sectors
    return reach, lambda distances: lidar.discretized(distances, sectors, values, reach)


def lidar_layout(name: str, config: Mapping[str, float]) -> tuple[float, int, int]:
    """The range of a lidar sensor in metres, its sectors, and the steps of a sector. Raises ValueError for another
    sensor."""
    if name == "LIDAR":
        return lidar.RAW_LIMIT_M, lidar.BEAMS, 1
    if name == "SECTOR_LIDAR":
        return lidar.SECTOR_LIMIT_M, lidar.SECTORS, 1
    if name == IN_STEPS:
        return config["clipping_dist"], int(config["num_sectors"]), int(config["num_values_per_sector"])
    raise ValueError(f"no lidar {name!r} here; there are {', '.join(LIDARS)}")


def _read_pose(car: Car, solids: Sequence[Solid], place: np.ndarray | None = None) -> np.ndarray:
    return _placed(np.array((*car.pose, car.speed)), place)


def _placed(reading: np.ndarray, place: np.ndarray | None) -> np.ndarray:
    if place is None:
        return reading
    np.copyto(place, reading, casting="no")
    return place
