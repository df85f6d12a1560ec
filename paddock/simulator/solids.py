"""What stands or drives on a track besides the car that looks: upright blocks for cameras, lidars and referees.

Sizes: deepracer-simapp, models/box_obstacle and track_geom/constants.py.
"""

from __future__ import annotations

from typing import NamedTuple

BOX, CAR = "box", "car"  # what a solid looks like


class Solid(NamedTuple):
    """A block on the ground: the middle of its floor (m), its heading (rad), half its length along the heading and half
    its width across (m), its height (m) and what it looks like."""

    x: float
    y: float
    yaw: float
    half_length: float
    half_width: float
    height: float
    look: str


def box(x: float, y: float, yaw: float) -> Solid:
    """A box obstacle as it is seen: 0.4 m across the road, 0.3 m along it, 0.25 m high."""
    return Solid(x, y, yaw, 0.15, 0.2, 0.25, BOX)


def car(x: float, y: float, yaw: float) -> Solid:
    """A car as it is seen by others; x, y is its base."""
    return Solid(x, y, yaw, 0.16176, 0.09805, 0.21, CAR)
