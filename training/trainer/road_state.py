"""The road around a car as the simulator knows it, in numbers: what the guide of a training sees, see
:class:`.learners.Learner`."""

from __future__ import annotations

import math

import numpy as np

from paddock.simulator.competitor import Competitor

_AHEAD_M = (0.3, 0.6, 1.0, 1.5, 2.0, 3.0)
MIRRORED = np.array([-1.0, -1.0, 1.0] * (1 + len(_AHEAD_M)), np.float32)  # factors that make the mirrored car's state
LENGTH = len(MIRRORED)


def road_state(car: Competitor) -> list[float]:
    """The car's place beside the centre line in half widths of the road, left is positive, and sine and cosine of its
    turn from the road's direction; for each of some points of the centre line ahead how far it lies to the left of the
    car's direction, by its distance, and sine and cosine of the turn to the road there."""
    referee = car.referee
    pose, track, place = referee.pose, referee.track, referee.odometer.seen
    turn = pose.yaw - place.heading
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    state = [2.0 * place.offset / track.width_at(place.distance), math.sin(turn), math.cos(turn)]
    for metres in _AHEAD_M:
        x, y, heading = track.point_at(place.distance + metres)
        left = (y - pose.y) * cos - (x - pose.x) * sin
        state += [left / metres, math.sin(heading - pose.yaw), math.cos(heading - pose.yaw)]
    return state
