"""What each sensor feeds a network: the tensor of one observation.

Source: deepracer-simapp, markov/sensors/utils.py (get_observation_space) after its grey-scale filter; deepracer.md 1.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

LIDAR_BEAMS = 64
_SECTORS = 8

CAMERAS = ("FRONT_FACING_CAMERA", "LEFT_CAMERA", "STEREO_CAMERAS", "observation")
LIDARS = ("LIDAR", "SECTOR_LIDAR", "DISCRETIZED_SECTOR_LIDAR")
SENSOR_NAMES = CAMERAS + LIDARS
MOST_FRAMES = 8  # that a network may read at once

# deepracer-simapp, boto/s3/constants.py (DiscretizedSectorLidarDefaults)
LIDAR_DEFAULTS: Mapping[str, float] = {"num_sectors": 8, "num_values_per_sector": 8, "clipping_dist": 2.0}


@dataclass(frozen=True)
class InputSpec:
    """One network input. ``shape`` is without the batch: (height, width, channels) or (values,); pictures are 0-255."""

    sensor: str
    shape: tuple[int, ...]

    @property
    def is_picture(self) -> bool:
        return len(self.shape) == 3

    @property
    def channels_last(self) -> tuple[int, ...]:
        """The shape with a batch of one; for pictures NHWC."""
        return (1, *self.shape)

    @property
    def channels_first(self) -> tuple[int, ...]:
        """For pictures NCHW, otherwise the same as :attr:`channels_last`."""
        if not self.is_picture:
            return self.channels_last
        height, width, channels = self.shape
        return (1, channels, height, width)

    def stacked(self, frames: int) -> InputSpec:
        """The input of a network that reads the last ``frames`` observations at once, joined as VecFrameStack of
        stable-baselines3 joins them: along the last axis (the channels of a picture), the newest last."""
        return replace(self, shape=(*self.shape[:-1], frames * self.shape[-1]))


def input_spec(sensor: str, lidar_config: Mapping[str, float] | None = None) -> InputSpec:
    """The input that ``sensor`` (one of :data:`SENSOR_NAMES`) feeds. KeyError for another name."""
    if sensor == "DISCRETIZED_SECTOR_LIDAR":
        config = lidar_settings(lidar_config)
        return InputSpec(sensor, (int(config["num_sectors"]) * int(config["num_values_per_sector"]),))
    return InputSpec(sensor, _SHAPES[sensor])


def lidar_settings(lidar_config: Mapping[str, float] | None = None) -> dict[str, float]:
    """All three settings of a DISCRETIZED_SECTOR_LIDAR: those of a checked ``lidar_config``, and the field's defaults
    where it has none."""
    return {**LIDAR_DEFAULTS, **(lidar_config or {})}


_SHAPES: dict[str, tuple[int, ...]] = {
    "FRONT_FACING_CAMERA": (120, 160, 1),
    "LEFT_CAMERA": (120, 160, 1),
    "observation": (120, 160, 1),
    "STEREO_CAMERAS": (120, 160, 2),
    "LIDAR": (LIDAR_BEAMS,),
    "SECTOR_LIDAR": (_SECTORS,),
}
