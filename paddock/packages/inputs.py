"""The registry of sensors, with the tensor that each feeds to a network."""

# Source: deepracer-simapp, markov/sensors/utils.py (get_observation_space) after its grey-scale filter.

from collections.abc import Mapping
from dataclasses import dataclass, replace

from paddock.errors.reasons import gettext_noop as _

LIDAR_BEAMS = 64
IN_STEPS = "DISCRETIZED_SECTOR_LIDAR"  # the lidar with settings


@dataclass(frozen=True)
class Sensor:
    """A sensor. ``label``: its name on pages; ``shape``: as in :class:`InputSpec`, empty where settings decide it."""

    name: str
    label: str
    shape: tuple[int, ...] = ()

    @property
    def is_camera(self) -> bool:
        return len(self.shape) == 3


SENSORS: Mapping[str, Sensor] = {
    sensor.name: sensor
    for sensor in (
        Sensor("FRONT_FACING_CAMERA", _("front camera"), (120, 160, 1)),
        Sensor("LEFT_CAMERA", _("left camera"), (120, 160, 1)),
        Sensor("STEREO_CAMERAS", _("stereo cameras"), (120, 160, 2)),
        Sensor("observation", _("front camera"), (120, 160, 1)),
        Sensor("LIDAR", _("lidar"), (LIDAR_BEAMS,)),
        Sensor("SECTOR_LIDAR", _("sector lidar"), (8,)),
        Sensor(IN_STEPS, _("sector lidar, discretized")),
    )
}
SENSOR_NAMES = tuple(SENSORS)
CAMERAS = tuple(name for name, sensor in SENSORS.items() if sensor.is_camera)
LIDARS = tuple(name for name in SENSORS if name not in CAMERAS)
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
        return (1, *self.shape)

    @property
    def channels_first(self) -> tuple[int, ...]:
        """For pictures NCHW, otherwise the same as :attr:`channels_last`."""
        if not self.is_picture:
            return self.channels_last
        height, width, channels = self.shape
        return (1, channels, height, width)

    def stacked(self, frames: int) -> "InputSpec":
        """The input for ``frames`` observations, joined along the last axis as by VecFrameStack, the newest last."""
        return replace(self, shape=(*self.shape[:-1], frames * self.shape[-1]))


def input_spec(sensor: str, lidar_config: Mapping[str, float] | None = None) -> InputSpec:
    """The input that ``sensor`` (one of :data:`SENSOR_NAMES`) feeds. KeyError for another name."""
    if sensor == IN_STEPS:
        config = lidar_settings(lidar_config)
        return InputSpec(sensor, (int(config["num_sectors"]) * int(config["num_values_per_sector"]),))
    return InputSpec(sensor, SENSORS[sensor].shape)


def lidar_settings(lidar_config: Mapping[str, float] | None = None) -> dict[str, float]:
    """The settings of a DISCRETIZED_SECTOR_LIDAR: a checked ``lidar_config``, completed with the field's defaults."""
    return {**LIDAR_DEFAULTS, **(lidar_config or {})}
