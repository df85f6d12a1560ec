"""The minimum-curvature line of a track and the lap time of a car on it: what trained cars are held against.

The line (Braghin et al., "Race driver model", Computers & Structures 86, 2008; Heilmeier et al., "Minimum curvature
trajectory planning and control for an autonomous race car", Vehicle System Dynamics 58, 2020): points on the centre
line's normals, so far from it that the sum of the squared curvatures along the way is least and half the car's width
stays between the car's path and the borders. Solved as a sequence of bounded linear least squares problems, each on the
line found before.

The lap time (the forward-backward solver of the same article): at each point the car drives as fast as its speed limit
and the curve allow, and between them it speeds up and brakes as hard as it can. In all that is left open this is the
faster choice: the lap has a flying start, the steering never lags, and the limit has the gain of the drive train (a car
that is told 3 m/s drives 3.09). Below the speeds at which curves slow a car down, though, a shorter line is faster.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.simulator.physics import PADDOCK_CAR, CarPhysics

SPACING_M = 0.2
_ROUNDS = 1000
_SETTLED_M = 1e-6
_LONGEST_STEP_M = 0.1  # of one round; longer ones end in lines that wander, of the same curvature and a greater length


@dataclass(frozen=True)
class RacingLine:
    """A closed line. ``points``: (N, 2) metres. ``offsets``: (N,) metres to the left of the centre line.
    ``curvatures``: (N,) 1/m, positive to the left; ``steps``: (N,) metres from each point to the next."""

    points: np.ndarray
    offsets: np.ndarray
    curvatures: np.ndarray
    steps: np.ndarray

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.steps.sum())

    def lap_s(self, speed_limit: float, physics: CarPhysics = PADDOCK_CAR) -> float:
        """Seconds of a flying lap of a car that is told to drive at most ``speed_limit`` m/s; see the module."""
        speeds = self.speeds(speed_limit, physics)
        following = np.roll(speeds, -1)
        return float((2.0 * self.steps / (speeds + following)).sum())

    def speeds(self, speed_limit: float, physics: CarPhysics = PADDOCK_CAR) -> np.ndarray:
        """(N,) m/s at the points: what the curve allows (``CarPhysics.curvature`` turned round), then what braking for
        it and speeding up out of it leave of that."""
        room = np.maximum(physics.curvature_limit / np.maximum(np.abs(self.curvatures), 1e-9) - 1.0, 0.0)
        in_curve = np.sqrt(room / physics.curvature_limit_falloff)
        speeds = np.clip(in_curve, physics.min_speed, speed_limit * physics.speed_gain)
        count = len(speeds)
        for _ in range(2):  # the second time round the lap begins as it ended
            for here in range(count):
                before = here - 1
                reach = math.sqrt(speeds[before] ** 2 + 2.0 * physics.acceleration * self.steps[before])
                speeds[here] = min(speeds[here], reach)
            for here in reversed(range(count)):
                reach = math.sqrt(speeds[(here + 1) % count] ** 2 + 2.0 * physics.braking * self.steps[here])
                speeds[here] = min(speeds[here], reach)
        return speeds


def line_at(track: TrackGeometry, distances: np.ndarray, offsets: np.ndarray) -> RacingLine:
    """The line ``offsets`` metres to the left of the centre line at ``distances`` from the finish."""
    points = track.points_at(distances, offsets)
    ahead = np.roll(points, -1, axis=0) - points
    behind = np.roll(ahead, 1, axis=0)
    steps = np.linalg.norm(ahead, axis=1)
    across = np.linalg.norm(ahead + behind, axis=1)
    turned = behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0]
    # of the circle through a point and its two neighbours: 4 x area of the triangle / product of its sides
    curvatures = 2.0 * turned / (steps * np.roll(steps, 1) * across)
    return RacingLine(points, offsets, curvatures, steps)


def centre_line(track: TrackGeometry) -> RacingLine:
    """The centre line itself."""
    count = max(round(track.length / SPACING_M), 16)
    return line_at(track, np.arange(count) * track.length / count, np.zeros(count))


def minimum_curvature_line(track: TrackGeometry, physics: CarPhysics = PADDOCK_CAR) -> RacingLine:
    """The line of least squared curvature on the road, half the car's body away from its borders."""
    count = len(centre_line(track).offsets)
    distances = np.arange(count) * track.length / count
    left, right = track.half_widths_along(distances)
    margin = physics.body_width / 2.0
    low, high = np.minimum(margin - right, 0.0), np.maximum(left - margin, 0.0)
    offsets, damping = np.zeros(count), 1e-3
    residuals, slopes = _bending(track, distances, offsets)
    for _ in range(_ROUNDS):
        # Points that would only press on against their border stay there; the others take a damped Gauss-Newton step
        # (two-metric projection: Bertsekas, SIAM Journal on Control and Optimization 20, 1982).
        downhill = -slopes.T @ residuals
        free = ~(((offsets <= low) & (downhill < 0)) | ((offsets >= high) & (downhill > 0)))
        bent = slopes[:, free]
        square = bent.T @ bent
        step = np.zeros(count)
        step[free] = np.linalg.solve(square + damping * np.eye(len(square)), downhill[free])
        moved = np.clip(offsets + np.clip(step, -_LONGEST_STEP_M, _LONGEST_STEP_M), low, high)
        after, slopes_after = _bending(track, distances, moved)
        if after @ after > residuals @ residuals:
            damping *= 4.0
            continue
        settled = np.abs(moved - offsets).max() < _SETTLED_M
        offsets, residuals, slopes, damping = moved, after, slopes_after, max(damping / 3.0, 1e-9)
        if settled:
            break
    return line_at(track, distances, offsets)


def _bending(track: TrackGeometry, distances: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is to be small, curvature x root of the way it holds for at each point, (N,), and its derivatives by the
    offsets, (N, N). A point touches its neighbours alone, so three differences tell all derivatives (five would where
    the count is no multiple of three: the last points are moved alone)."""

    def weigh(given: np.ndarray) -> np.ndarray:
        line = line_at(track, distances, given)
        return line.curvatures * np.sqrt((line.steps + np.roll(line.steps, 1)) / 2.0)

    residuals, count, small = weigh(offsets), len(offsets), 1e-6
    slopes = np.zeros((count, count))
    even = count - count % 3
    for moved in (*(range(first, even, 3) for first in range(3)), *((last,) for last in range(even, count))):
        numbers = np.array(moved)
        shifted = offsets.copy()
        shifted[numbers] += small
        change = (weigh(shifted) - residuals) / small
        for near in (-1, 0, 1):
            touched = (numbers + near) % count
            slopes[touched, numbers] = change[touched]
    return residuals, slopes
