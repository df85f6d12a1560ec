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
    count = max(round(track.length / STEP_M), 16)
    distances = np.arange(count) * (track.length / count)
    apart = max(round(SMOOTH_M / track.length * count), 1)
    places = distances - SMOOTH_M / 2
    if track.is_open:  # beyond its end it goes straight on
        places = np.append(places, places[-1] + track.length / count * np.arange(1, apart + 1))
    headings = np.array([track.point_at(distance)[2] for distance in places])
    turned = np.angle(np.exp(1j * (np.roll(headings, -apart) - headings)))[:count]
    curvature = turned * (count / (apart * track.length))
    slowed = np.minimum(TOP_SPEED, np.sqrt(SIDEWAYS / np.maximum(np.abs(curvature), 1e-9)))
    given_away = 1.0 - 1.0 / float((TOP_SPEED / slowed).mean())
    difficulty = 100.0 * given_away * ROAD_M / median_width(track)
    step = track.length / count
    if track.is_open:  # no corner goes on from its end to its start
        curvature = np.append(curvature, 0.0)
    return Character(_corners(curvature, step), min(round(difficulty), 100))


def _corners(curvature: np.ndarray, step: float) -> int:
    """The number of stretches of one sign that turn far enough, counted round the loop."""
    sign = np.where(np.abs(curvature) < BENT, 0.0, np.sign(curvature))
    changes = np.flatnonzero(sign != np.roll(sign, 1))
    if not len(changes):  # a circle is one corner, a straight none
        return int(sign[0] != 0.0)
    stretches = np.split(np.roll(curvature, -changes[0]), (changes - changes[0])[1:])
    signs = np.roll(sign, -changes[0])[changes - changes[0]]
    degrees = [abs(math.degrees(float(stretch.sum()) * step)) for stretch in stretches]
    return sum(1 for sign, turn in zip(signs, degrees, strict=True) if sign and turn >= CORNER_DEGREES)
