"""What a car may carry, and how a reading is laid out in memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .camera.view import Camera, Scene
from .car import Car


@dataclass(frozen=True)
class SensorSpec:
    """Shape and type of one sensor's reading: cameras are (rows, columns, channels)."""

    name: str
    shape: tuple[int, ...]
    dtype: str

    @property
    def nbytes(self) -> int:
        """Bytes of one reading."""
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize


# deepracer-simapp, sensors/sensors_rollout.py: "observation" is the name of the one camera in the oldest models.
SENSORS: dict[str, SensorSpec] = {
    name: SensorSpec(name, (120, 160, 1), "uint8") for name in ("FRONT_FACING_CAMERA", "observation")
}

# For scripted drivers only, never offered to a model: base x, y (m), yaw (rad), speed (m/s).
POSE = "POSE"

Reading = Callable[[Car], np.ndarray]


def sensor_spec(name: str) -> SensorSpec:
    """The spec of a sensor. Raises ValueError for one that this simulator does not have."""
    if name not in SENSORS:
        raise ValueError(f"no sensor {name!r} here; there are {', '.join(sorted(SENSORS))}")
    return SENSORS[name]


def make_sensors(names: Sequence[str], scene: Callable[[], Scene]) -> dict[str, Reading]:
    """A reading function for each sensor name, in sorted order. ``scene`` is only drawn when a camera needs it.

    Raises ValueError for a sensor that this simulator does not have; races refuse such a model before it comes here.
    """
    readings: dict[str, Reading] = {}
    for name in sorted(set(names)):
        if name == POSE:
            readings[name] = _read_pose
        else:
            sensor_spec(name)
            readings[name] = _camera_reading(Camera(scene()))
    return readings


def _camera_reading(camera: Camera) -> Reading:
    def read(car: Car) -> np.ndarray:
        return camera.render(car.pose)[:, :, None]

    return read


def _read_pose(car: Car) -> np.ndarray:
    return np.array((*car.pose, car.speed))
