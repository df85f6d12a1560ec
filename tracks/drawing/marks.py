"""What is marked on a map besides the road: boxes where they stand, and the two lanes. No Django."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from paddock.geometry.checks import Points
from paddock.geometry.track import TrackGeometry

LANE_STEP_M = 0.15


class BoxMark(NamedTuple):
    """A box on a map: its middle (m), heading (rad), half its length along the heading and half its width across (m),
    the number beside which it is listed (0: none is drawn), what a pointer or a screen reader is told, and
    whether it cannot stand there."""

    x: float
    y: float
    yaw: float
    half_length: float
    half_width: float
    number: int = 0
    title: str = ""
    wrong: bool = False


def box_corners(box: BoxMark, least_m: float) -> list[tuple[float, float]]:
    """The four corners of the box in metres, enlarged about its middle so that half its length is ``least_m`` at
    least: true to scale it would vanish on the map of a long track."""
    scale = max(1.0, least_m / box.half_length)
    cos, sin = math.cos(box.yaw), math.sin(box.yaw)
    reach, side = scale * box.half_length, scale * box.half_width
    return [
        (box.x + a * cos - b * sin, box.y + a * sin + b * cos)
        for a, b in ((reach, side), (-reach, side), (-reach, -side), (reach, -side))
    ]


def lane_line(track: TrackGeometry, lane: str) -> Points:
    """The middle of the ``"inner"`` or ``"outer"`` lane all round, (n, 2) in metres, the first point not repeated; of
    an open track from start to end."""
    count = max(8, round(track.length / LANE_STEP_M))
    places = range(count + track.is_open)
    return np.array([track.lane_centre(track.length * k / count, lane)[:2] for k in places])
