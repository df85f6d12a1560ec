"""The learner's observations: all sensors of a car in one row, pictures pooled.

Pooling outside the learner makes a rollout sixteen times smaller and learning about twice as fast. A network that reads
every pixel gets rows of bytes.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paddock.packages.inputs import InputSpec, input_spec

POOL = 4  # a picture's 4 x 4 pixels become their mean
_LIDAR_SCALE = {"LIDAR": 0.25}  # metres (up to 12): numbers of about 1 learn best; sector lidars are 0 or 1


@dataclass(frozen=True)
class Sense:
    """One sensor's place in the row: ``[start, stop)``, for a picture as (channels, rows, columns) of ``shape``."""

    spec: InputSpec
    start: int
    shape: tuple[int, ...]
    scale: float  # of the network's own input
    pool: int = POOL

    @property
    def name(self) -> str:
        return self.spec.sensor

    @property
    def stop(self) -> int:
        return self.start + int(np.prod(self.shape))


def senses_of(
    sensors: list[str] | tuple[str, ...], lidar_config: Mapping[str, float] | None = None, pool: int = POOL
) -> list[Sense]:
    """The sensors in the order of their names, as they lie in the row. ``pool``: 4, or 1 for every pixel.

    Raises LookupError for a lidar beside unpooled pictures: a row of bytes has no place for metres.
    """
    senses: list[Sense] = []
    start = 0
    for name in sorted(sensors):
        spec = input_spec(name, lidar_config)
        if spec.is_picture:
            rows, columns, channels = spec.shape
            sense = Sense(spec, start, (channels, rows // pool, columns // pool), 1.0 / 255.0, pool)
        elif pool == 1:
            raise LookupError(name)
        else:
            sense = Sense(spec, start, spec.shape, _LIDAR_SCALE.get(name, 1.0))
        senses.append(sense)
        start = sense.stop
    return senses


def look(senses: list[Sense], readings: Mapping[str, np.ndarray]) -> np.ndarray:
    """Readings of n cars (each sensor's array with the car first) as (n, length of the row): float32, or uint8 where
    pictures are not pooled."""
    rows = []
    for sense in senses:
        batch = readings[sense.name]
        if sense.pool == 1:
            rows.append(batch.transpose(0, 3, 1, 2).reshape(len(batch), -1))
        elif sense.spec.is_picture:
            channels, height, width = sense.shape
            # whole numbers below 2**12: uint16 sums of 16 pixels are exact, and fast
            columns = batch[:, 0::POOL].astype(np.uint16)
            for offset in range(1, POOL):
                columns += batch[:, offset::POOL]
            blocks = columns[:, :, 0::POOL].copy()
            for offset in range(1, POOL):
                blocks += columns[:, :, offset::POOL]
            pooled = blocks.transpose(0, 3, 1, 2).reshape(len(batch), channels * height * width)
            rows.append(pooled.astype(np.float32) * np.float32(sense.scale / POOL**2))
        else:
            rows.append(batch.astype(np.float32) * np.float32(sense.scale))
    return rows[0] if len(rows) == 1 else np.concatenate(rows, axis=1)
