"""The line that trained cars are held against bends as little as the road allows; its lap is driven at the limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paddock.analysis.racing_line import RacingLine, best_line, line_at, places_along
from paddock.geometry.catalogue import CATALOGUE
from paddock.geometry.track import TrackGeometry
from paddock.simulator.physics import PADDOCK_CAR

HALF_BODY = PADDOCK_CAR.body_width / 2


def ring(radius: float, width: float = 1.0, stretch: float = 0.0) -> TrackGeometry:
    """A circular road, or one with two straights of ``stretch`` metres."""
    angles = np.arange(0, 2 * math.pi, 2 * math.pi / 240)

    def line(at: float) -> np.ndarray:
        circle = at * np.column_stack((np.cos(angles), np.sin(angles)))
        return circle + np.column_stack((np.where(np.cos(angles) > 0, stretch / 2, -stretch / 2), np.zeros(240)))

    return TrackGeometry.from_arrays("ring", line(radius), line(radius - width / 2), line(radius + width / 2))


def centre_line(track: TrackGeometry) -> RacingLine:
    distances = places_along(track)
    return line_at(track, distances, np.zeros(len(distances)))


def test_on_a_circle_the_line_is_the_widest_that_fits_the_body():
    line = best_line(ring(3.0), HALF_BODY)
    widest = 3.5 - HALF_BODY
    assert line.offsets == pytest.approx(-(0.5 - HALF_BODY), abs=0.01)
    assert line.curvatures == pytest.approx(1 / widest, rel=0.01)
    assert line.length == pytest.approx(2 * math.pi * widest, rel=0.01)


def test_a_lap_at_a_speed_limit_takes_its_length_over_speed():
    line = best_line(ring(3.0), HALF_BODY)
    assert line.lap_s(1.0) == pytest.approx(line.length / PADDOCK_CAR.speed_gain)


def test_no_point_is_driven_faster_than_the_grip_allows():
    line = centre_line(ring(0.8, width=0.6, stretch=6.0))
    speeds = line.speeds(4.0)
    for speed, curvature in zip(speeds, line.curvatures, strict=True):
        limit = PADDOCK_CAR.curvature_limit / (1 + PADDOCK_CAR.curvature_limit_falloff * speed**2)
        assert abs(curvature) <= limit + 1e-6
    assert speeds.max() > 3.5, "there are straights"
    in_the_bend = math.sqrt((PADDOCK_CAR.curvature_limit * 0.8 - 1) / PADDOCK_CAR.curvature_limit_falloff)
    assert speeds.min() == pytest.approx(in_the_bend, rel=0.02), "and bends"


def test_speed_changes_no_faster_than_the_car_can():
    line = centre_line(ring(0.8, width=0.6, stretch=6.0))
    speeds = line.speeds(4.0)
    gained = (np.roll(speeds, -1) ** 2 - speeds**2) / (2 * line.steps)
    assert gained.max() == pytest.approx(PADDOCK_CAR.acceleration)
    assert gained.min() == pytest.approx(-PADDOCK_CAR.braking)


@pytest.mark.parametrize("slug", ["oval", "kuei-raceway"])
def test_no_nearby_line_bends_less(slug):
    track = next(entry for entry in CATALOGUE if entry.slug == slug).geometry()
    best, centre = best_line(track, HALF_BODY), centre_line(track)
    distances = np.arange(len(best.offsets)) * track.length / len(best.offsets)

    def bending(line) -> float:
        return float((line.curvatures**2 * (line.steps + np.roll(line.steps, 1)) / 2).sum())

    assert bending(best) < 0.8 * bending(centre)
    left, right = track.half_widths_along(distances)
    assert (best.offsets <= left - HALF_BODY + 1e-9).all() and (best.offsets >= HALF_BODY - right - 1e-9).all()
    rng = np.random.default_rng(0)
    for _ in range(50):  # smooth swerves of a centimetre or so, kept on the road
        at, width = rng.uniform(0, track.length), rng.uniform(0.5, 3.0)
        away = np.abs((distances - at + track.length / 2) % track.length - track.length / 2)
        swerve = rng.choice((-0.01, 0.01)) * np.exp(-((away / width) ** 2))
        other = np.clip(best.offsets + swerve, HALF_BODY - right, left - HALF_BODY)
        assert bending(line_at(track, distances, other)) >= bending(best) - 1e-6
