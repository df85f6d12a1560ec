"""The lidar: its beams, their hits, and the three readings that networks get from one scan."""

# Beams, range and mount: deepracer-simapp, sensors/constants.py and urdf/deepracer/deepracer_stereo_cam_lidar.urdf.
# Encodings: its agents' input filters (clipping, binary sectors, ObservationSectorDiscretizeFilter).

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .solids import Solid

if TYPE_CHECKING:  # a lidar needs no physics
    from .car import Pose

BEAMS = 64
MOUNT_X = 0.02913  # m ahead of the base
FIRST_DEG, LAST_DEG = -150.0, 150.0  # of the unit; its own zero points backwards, see BEAM_DEG
LEAST_M, MOST_M = 0.15, 12.0
STEP_M = 0.01  # the unit's resolution: readings are rounded to it

# Bearings (degrees, positive is left) of the beams. The unit is mounted backwards: the first beam is 30 degrees left of
# straight ahead, the others go round over the left side, the rear and the right side.
BEAM_DEG: tuple[float, ...] = tuple(
    math.remainder(180.0 + FIRST_DEG + (LAST_DEG - FIRST_DEG) * number / (BEAMS - 1), 360.0) for number in range(BEAMS)
)

RAW_LIMIT_M = 1.0  # LIDAR is clipped to this
SECTORS = 8
SECTOR_LIMIT_M = 0.5  # the range of SECTOR_LIDAR

_COS = np.array([math.cos(math.radians(bearing)) for bearing in BEAM_DEG])
_SIN = np.array([math.sin(math.radians(bearing)) for bearing in BEAM_DEG])
_TINY = 1e-30  # a beam along a face has no inverse

Hall = tuple[float, float, float, float]  # the walls: xmin, ymin, xmax, ymax


def scan(pose: Pose, solids: Sequence[Solid], hall: Hall, reach: float = MOST_M) -> np.ndarray:
    """Distances (m) of the nearest surface on each beam, ``LEAST_M`` to ``reach`` in steps of ``STEP_M``: float64
    (64,), a fresh array. Boxes, cars and the hall's walls stand higher than the unit. The official unit adds noise of
    0.01 m, this one none."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y = pose.x + MOUNT_X * cos, pose.y + MOUNT_X * sin
    # for each block and each of its two axes: the place of the unit, half the size, and the axis in the car's frame
    lengthwise, across = [], []
    for block in solids:
        dx, dy = x - block.x, y - block.y
        if math.hypot(dx, dy) - math.hypot(block.half_length, block.half_width) < reach:
            c, s = math.cos(block.yaw), math.sin(block.yaw)
            ahead, left = cos * c + sin * s, sin * c - cos * s
            lengthwise.append((dx * c + dy * s, block.half_length, ahead, -left))
            across.append((dy * c - dx * s, block.half_width, left, ahead))
    xmin, ymin, xmax, ymax = hall
    walls = min(x - xmin, xmax - x, y - ymin, ymax - y) < reach
    if walls:  # the hall is a block like the others, but seen from inside
        lengthwise.append((x - (xmin + xmax) / 2, (xmax - xmin) / 2, cos, -sin))
        across.append((y - (ymin + ymax) / 2, (ymax - ymin) / 2, sin, cos))
    if not lengthwise:
        return np.full(BEAMS, float(reach))
    enter, leave = _cross(np.array((lengthwise, across)))
    # A beam that misses leaves before it enters; one that points away leaves behind the unit.
    np.putmask(enter, (enter > leave) | (leave < 0.0), reach)
    if walls:
        enter[-1] = np.where(leave[-1] > 0.0, leave[-1], reach)
    nearest = enter.min(axis=0)
    np.minimum(np.maximum(nearest, LEAST_M, out=nearest), reach, out=nearest)
    # by 100 and not by 0.01: the quotient is the float nearest to the decimal number
    return np.rint(nearest * 100.0) / 100.0


def _cross(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the beams enter and leave each rectangle (slab test): two arrays (blocks, 64) of metres along the beam.
    ``blocks``: (2 axes, blocks, 4) of the unit's place on the axis, half the size, and the axis' x and y."""
    place, half, along, aside = blocks[:, :, :, None].transpose(2, 0, 1, 3)
    slope = along * _COS
    slope += aside * _SIN
    slope += _TINY
    np.divide(1.0, slope, out=slope)
    middle = place * slope
    np.abs(slope, out=slope)
    slope *= half
    enter, leave = -slope - middle, slope - middle
    return np.maximum(*enter), np.minimum(*leave)


def raw(distances: np.ndarray) -> np.ndarray:
    """LIDAR: float32 (64,), metres clipped to 0.15-1.0."""
    return np.clip(distances, LEAST_M, RAW_LIMIT_M).astype(np.float32)


def sectors(distances: np.ndarray) -> np.ndarray:
    """SECTOR_LIDAR: float32 (8,), 1.0 where one of the sector's eight beams is shorter than 0.5 m, else 0.0."""
    return (distances.reshape(SECTORS, -1).min(axis=1) < SECTOR_LIMIT_M).astype(np.float32)


def discretized(distances: np.ndarray, num_sectors: int, num_values: int, clipping_dist: float) -> np.ndarray:
    """DISCRETIZED_SECTOR_LIDAR: float32 (num_sectors * num_values,), for each sector a one-hot group of its nearest
    reading in ``num_values`` equal steps of ``clipping_dist``; zeros where nothing is nearer."""
    groups = np.zeros(num_sectors * num_values, np.float32)
    for sector, nearest in enumerate(distances.reshape(num_sectors, -1).min(axis=1).tolist()):
        if nearest < clipping_dist:
            # a reading on the edge of two steps is in the farther one
            step = int(nearest * (num_values / clipping_dist) + 1e-9)
            if step < num_values:
                groups[sector * num_values + step] = 1.0
    return groups
