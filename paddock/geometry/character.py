"""Counts the corners of a track and rates its difficulty."""

import math
from typing import NamedTuple

import numpy as np

from .track import TrackGeometry

STEP_M = 0.1
SMOOTH_M = 0.6  # between compared headings: waypoints of the old files lie up to 0.7 m apart
BENT = 0.2  # 1/m: a bend of a greater radius than 5 m is a straight
CORNER_DEGREES = 30.0  # the least turning of a corner
TOP_SPEED = 4.0  # m/s, of the old console's cars
SIDEWAYS = 4.0  # m/s2 of the reference car in a bend
ROAD_M = 1.07  # the usual width of the league's roads


class Character(NamedTuple):
    corners: int
    difficulty: int


def median_width(track: TrackGeometry) -> float:
    """The median over the waypoints of the metres between the borders."""
    left, right = track.half_widths_along(track.cumulative)
    return float(np.median(left + right))


def character_of(track: TrackGeometry) -> Character:
    """The character of a track; the same in both directions.

    A corner turns one way, tighter than a radius of 5 m, by at least 30 degrees. The difficulty is the share of a lap,
    in per cent, that a car in the middle of the road loses in bends (at most 4 m/s and 4 m/s2 sideways), times 1.07 m
    over the road's median width; at most 100.
    """
    curvature = curvature_along(track)[0]
    slowed = np.minimum(TOP_SPEED, np.sqrt(SIDEWAYS / np.maximum(np.abs(curvature), 1e-9)))
    given_away = 1.0 - 1.0 / float((TOP_SPEED / slowed).mean())
    difficulty = 100.0 * given_away * ROAD_M / median_width(track)
    return Character(len(corners_of(track)), min(round(difficulty), 100))


def curvature_along(track: TrackGeometry) -> tuple[np.ndarray, float]:
    """The curvature (1/m, positive to the left) at even distances from the finish, smoothed over ``SMOOTH_M``, and the
    metres between them."""
    count = max(round(track.length / STEP_M), 16)
    step = track.length / count
    apart = max(round(SMOOTH_M / step), 1)
    places = np.arange(count + apart * track.is_open) * step - SMOOTH_M / 2  # an open track goes straight on at its end
    headings = np.array([track.point_at(distance)[2] for distance in places.tolist()])
    turned = np.angle(np.exp(1j * (np.roll(headings, -apart) - headings)))[:count]
    return turned / (apart * step), step


def corners_of(track: TrackGeometry) -> list[tuple[int, np.ndarray]]:
    """The corners by driving direction, from the finish: the first row of :func:`curvature_along` (the last corner of a
    loop may begin in one lap and end in the next) and the radians turned in each row."""
    curvature, step = curvature_along(track)
    turned = curvature * step
    if track.is_open:  # no corner goes on from its end to its start
        turned = np.append(turned, 0.0)
    sign = np.where(np.abs(turned) < BENT * step, 0.0, np.sign(turned))
    firsts = np.flatnonzero(sign != np.roll(sign, 1))
    if not len(firsts):  # a circle is one corner, a straight none
        return [(0, turned)] if sign[0] else []
    stretches = np.split(np.roll(turned, -firsts[0]), (firsts - firsts[0])[1:])
    return [
        (first, stretch)
        for first, stretch in zip(firsts.tolist(), stretches, strict=True)
        if sign[first] and abs(math.degrees(float(stretch.sum()))) >= CORNER_DEGREES
    ]
