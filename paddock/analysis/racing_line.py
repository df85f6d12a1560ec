"""The racing line of a track: lines of least curvature or of less length, and the car's speeds on them."""

# The line (Braghin et al., "Race driver model", Computers & Structures 86, 2008; Heilmeier et al., "Minimum curvature
# trajectory planning and control for an autonomous race car", Vehicle System Dynamics 58, 2020): points on the centre
# line's normals, so far from it that the sum of the squared curvatures along the way is least and the car's path stays
# away from the borders. Solved as a sequence of bounded linear least squares problems, each on the line found before.
#
# The lap time (the forward-backward solver of the same article): at each point the car drives as fast as its speed
# limit and the curve allow, and between them it speeds up and brakes as hard as it can. In all that is left open this
# is the faster choice: the lap has a flying start, the steering never lags, and the limit has the gain of the drive
# train (a command of 3 m/s is driven as 3.09). Below the speeds at which curves slow a car down, though, a shorter line
# is faster.

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.simulator.physics import PADDOCK_CAR, CarPhysics

SPACING_M = 0.2
_MOST_POINTS = 600  # of a longer track the points lie farther apart: the work grows with their cube
_ROUNDS = 1000
_SETTLED_M = 1e-6
_MOST_DAMPING = 1e12  # no step is small enough to improve the line any more
_LONGEST_STEP_M = 0.1  # of one round; longer ones end in lines that wander, of the same curvature and a greater length


@dataclass(frozen=True)
class RacingLine:
    """A line along a track, closed unless the track is open. ``points``: (N, 2) metres. ``offsets``: (N,) metres to the
    left of the centre line. ``curvatures``: (N,) 1/m, positive to the left; ``steps``: (N,) metres from each point to
    the next, 0 at the end of an open line."""

    points: np.ndarray
    offsets: np.ndarray
    curvatures: np.ndarray
    steps: np.ndarray
    is_open: bool = False

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.steps.sum())

    def lap_s(self, speed_limit: float) -> float:
        """Seconds of a flying lap of a car with commands of at most ``speed_limit`` m/s; see the module."""
        speeds = self.speeds(speed_limit)
        return float((2.0 * self.steps / (speeds + np.roll(speeds, -1))).sum())

    def speeds(self, speed_limit: float, physics: CarPhysics = PADDOCK_CAR, grip: float = 1.0) -> np.ndarray:
        """(N,) m/s at the points: what the curve allows (``CarPhysics.curvature`` turned round) with the share ``grip``
        of the limit, then what braking for it and speeding up out of it leave of that. An open line begins at rest."""
        room = np.maximum(grip * physics.curvature_limit / np.maximum(np.abs(self.curvatures), 1e-9) - 1.0, 0.0)
        in_curve = np.sqrt(room / physics.curvature_limit_falloff)
        speeds = np.clip(in_curve, physics.min_speed, speed_limit * physics.speed_gain)
        count = len(speeds)
        if self.is_open:
            speeds[0] = physics.min_speed
        for _ in range(1 if self.is_open else 2):  # the second time round the lap begins as it ended
            for here in range(self.is_open, count):
                before = here - 1
                reach = math.sqrt(speeds[before] ** 2 + 2.0 * physics.acceleration * self.steps[before])
                speeds[here] = min(speeds[here], reach)
            for here in reversed(range(count - self.is_open)):
                reach = math.sqrt(speeds[(here + 1) % count] ** 2 + 2.0 * physics.braking * self.steps[here])
                speeds[here] = min(speeds[here], reach)
        return speeds


def line_at(track: TrackGeometry, distances: np.ndarray, offsets: np.ndarray) -> RacingLine:
    """The line ``offsets`` metres to the left of the centre line at ``distances`` from the finish."""
    points = track.points_at(distances, offsets)
    if track.is_open:  # straight on at both ends
        leads = np.diff(points, axis=0)
        ahead, behind = np.vstack((leads, leads[-1:])), np.vstack((leads[:1], leads))
    else:
        ahead = np.roll(points, -1, axis=0) - points
        behind = np.roll(ahead, 1, axis=0)
    steps = np.linalg.norm(ahead, axis=1)
    across = np.linalg.norm(ahead + behind, axis=1)
    turned = behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0]
    # of the circle through a point and its two neighbours: 4 x area of the triangle / product of its sides
    curvatures = 2.0 * turned / (steps * np.linalg.norm(behind, axis=1) * across)
    if track.is_open:
        steps[-1] = 0.0
    return RacingLine(points, offsets, curvatures, steps, track.is_open)


def places_along(track: TrackGeometry) -> np.ndarray:
    """The distances of a line's points from the finish, on an open track to its very end."""
    count = min(max(round(track.length / SPACING_M), 16), _MOST_POINTS)
    return np.arange(count + track.is_open) * track.length / count


def best_line(
    track: TrackGeometry,
    margin: float,
    shortness: float = 0.0,
    settled_m: float = _SETTLED_M,
) -> RacingLine:
    """The line on the road of the least sum of squared curvature (1/m^2) and ``shortness`` times length (m), both along
    the way, ``margin`` metres away from the borders. ``settled_m``: ends the search once no point moves farther."""
    distances = places_along(track)
    count = len(distances)
    left, right = track.half_widths_along(distances)
    low, high = np.minimum(margin - right, 0.0), np.maximum(left - margin, 0.0)
    if track.is_open:  # where cars start
        low[0] = high[0] = 0.0
    offsets = np.zeros(count)
    damping = 1e-3
    residuals, slopes = _costs(track, distances, offsets, shortness)
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
        after, slopes_after = _costs(track, distances, moved, shortness)
        if after @ after > residuals @ residuals:
            damping *= 4.0
            if damping > _MOST_DAMPING:
                break
            continue
        settled = np.abs(moved - offsets).max() < settled_m
        offsets, residuals, slopes, damping = moved, after, slopes_after, max(damping / 3.0, 1e-9)
        if settled:
            break
    return line_at(track, distances, offsets)


def _costs(
    track: TrackGeometry, distances: np.ndarray, offsets: np.ndarray, shortness: float
) -> tuple[np.ndarray, np.ndarray]:
    """The residuals whose squares are to be small, and their derivatives by the N offsets: curvature x root of the way
    it holds for at each point, and with ``shortness`` the steps. A point touches its neighbours alone, so three
    differences tell all derivatives (five would where the count is no multiple of three: the last points are moved
    alone)."""
    count, small = len(offsets), 1e-6
    weight = math.sqrt(shortness * count / track.length)  # of a step: its square over the usual step adds up to metres

    def weigh(given: np.ndarray) -> np.ndarray:
        line = line_at(track, distances, given)
        bent = line.curvatures * np.sqrt((line.steps + np.roll(line.steps, 1)) / 2.0)
        return np.stack((bent, weight * line.steps)) if shortness else bent[None]

    residuals = weigh(offsets)
    slopes = np.zeros((*residuals.shape, count))
    even = count - count % 3
    for moved in (*(range(first, even, 3) for first in range(3)), *((last,) for last in range(even, count))):
        numbers = np.array(moved)
        shifted = offsets.copy()
        shifted[numbers] += small
        change = (weigh(shifted) - residuals) / small
        for near in (-1, 0, 1):
            touched = (numbers + near) % count
            slopes[:, touched, numbers] = change[:, touched]
    return residuals.reshape(-1), slopes.reshape(-1, count)
