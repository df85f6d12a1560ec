"""Upright blocks on a track, as cameras, lidars and referees see them, and whether two of them touch."""

# Sizes: deepracer-simapp, models/box_obstacle and track_geom/constants.py.

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # a block needs no physics
    from .car import Pose

BOX, CAR = "box", "car"  # what a solid looks like

# Half the length along the road and half the width of a box as it is judged: deepracer-simapp's rectangle of
# 0.4 x 0.5 m, which is the box with 0.05 m around it.
BOX_HALF_LENGTH_M, BOX_HALF_WIDTH_M = 0.2, 0.25
CAR_HALF_LENGTH_M, CAR_HALF_WIDTH_M = 0.16176, 0.09805

# Middles farther apart than this (squared, m^2) cannot touch.
_CAR_RADIUS_M = math.hypot(CAR_HALF_LENGTH_M, CAR_HALF_WIDTH_M)
CARS_NEAR_M2 = (2 * _CAR_RADIUS_M) ** 2
BOX_NEAR_M2 = (_CAR_RADIUS_M + math.hypot(BOX_HALF_LENGTH_M, BOX_HALF_WIDTH_M)) ** 2


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
    """A box as it is seen: 0.4 m across the road, 0.3 m along it, 0.25 m high."""
    return Solid(x, y, yaw, 0.15, 0.2, 0.25, BOX)


def car(x: float, y: float, yaw: float) -> Solid:
    """A car as it is seen by others; x, y is its base."""
    return Solid(x, y, yaw, CAR_HALF_LENGTH_M, CAR_HALF_WIDTH_M, 0.21, CAR)


def corner_inside(
    x: float,
    y: float,
    yaw: float,
    half_length: float,
    half_width: float,
    other: tuple[float, float, float, float, float],
) -> bool:
    """True where a corner of the first rectangle lies in or on ``other`` (x, y, yaw, half length, half width)."""
    other_x, other_y, other_yaw, other_length, other_width = other
    cos, sin = math.cos(other_yaw), math.sin(other_yaw)
    dx, dy = x - other_x, y - other_y
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    turned = yaw - other_yaw
    cos, sin = math.cos(turned), math.sin(turned)
    long_x, long_y = half_length * cos, half_length * sin
    wide_x, wide_y = -half_width * sin, half_width * cos
    return (
        (abs(along + long_x + wide_x) <= other_length and abs(across + long_y + wide_y) <= other_width)
        or (abs(along + long_x - wide_x) <= other_length and abs(across + long_y - wide_y) <= other_width)
        or (abs(along - long_x + wide_x) <= other_length and abs(across - long_y + wide_y) <= other_width)
        or (abs(along - long_x - wide_x) <= other_length and abs(across - long_y - wide_y) <= other_width)
    )


def hits_box(pose: Pose, solid: Solid) -> bool:
    """True where a corner of the car lies in the box's judged rectangle (deepracer-simapp, reset/rules/crash.py;
    corners of the box inside the car do not count)."""
    dx, dy = pose.x - solid.x, pose.y - solid.y
    if dx * dx + dy * dy > BOX_NEAR_M2:
        return False
    box = (solid.x, solid.y, solid.yaw, BOX_HALF_LENGTH_M, BOX_HALF_WIDTH_M)
    return corner_inside(*pose, CAR_HALF_LENGTH_M, CAR_HALF_WIDTH_M, box)


def cars_touch(a: Pose, b: Pose, gap: float = 0.0) -> bool:
    """True where a corner of one car lies in the other, or within ``gap`` metres of its sides."""
    dx, dy = a.x - b.x, a.y - b.y
    if gap == 0.0 and dx * dx + dy * dy > CARS_NEAR_M2:
        return False
    length, width = CAR_HALF_LENGTH_M, CAR_HALF_WIDTH_M
    return corner_inside(*a, length, width, (*b, length + gap, width + gap)) or corner_inside(
        *b, length, width, (*a, length + gap, width + gap)
    )


def overlaps_box(pose: Pose, solid: Solid) -> bool:
    """True where the car and the box's judged rectangle overlap, whosever corner it is: no place to put a car."""
    dx, dy = pose.x - solid.x, pose.y - solid.y
    if dx * dx + dy * dy > BOX_NEAR_M2:
        return False
    rectangle = (*pose, CAR_HALF_LENGTH_M, CAR_HALF_WIDTH_M)
    box = (solid.x, solid.y, solid.yaw, BOX_HALF_LENGTH_M, BOX_HALF_WIDTH_M)
    return corner_inside(*rectangle, box) or corner_inside(*box, rectangle)
