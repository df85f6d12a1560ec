"""The reference lap is driven by an ordinary entrant at the limit of the car, and the referee accepts it."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from paddock.analysis.racing_line import best_line
from paddock.analysis.reference_lap import (
    CAR_SPACE,
    LAPS,
    DrivingStyle,
    LineDriver,
    ReferenceRun,
    drive_line,
    drive_reference,
)
from paddock.geometry.catalogue import by_slug
from paddock.geometry.track import TrackGeometry
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.stage import PreparedTrack
from tests.soak import only
from training.house_cars.recipes import TRACKS

HOUSE_CARS = Path("training/house_cars")


@cache
def reference(slug: str, direction: str) -> ReferenceRun:
    found = drive_reference(by_slug(slug).geometry(), direction)
    assert found is not None
    return found


def best_house_lap(slug: str, direction: str) -> int:
    measured = [json.loads((HOUSE_CARS / f"{name}.json").read_text()) for name in ("steady", "brisk", "flyer")]
    return min(car["house_car"]["measured"][slug][direction]["best_lap_ms"] for car in measured)


def bend(radius: float, turn: float = math.pi) -> TrackGeometry:
    """An open track: a bend of so many radians between straights of two metres."""
    angles = np.linspace(0.0, turn, 60)

    def line(aside: float) -> np.ndarray:
        arc = np.column_stack(((radius - aside) * np.sin(angles), radius - (radius - aside) * np.cos(angles)))
        lead = np.column_stack((np.linspace(-2.0, 0.0, 20, endpoint=False), np.full(20, arc[0, 1])))
        ahead = np.array((math.cos(turn), math.sin(turn)))
        return np.vstack((lead, arc, arc[-1] + np.linspace(0.1, 2.0, 20)[:, None] * ahead))

    return TrackGeometry.from_arrays("bend", line(0.0), line(0.4), line(-0.4), is_open=True)


@pytest.mark.parametrize("direction", only(["ccw"], ["ccw", "cw"]))
def test_the_referee_accepts_all_laps_of_a_reference(direction):
    result = reference("oval", direction).result
    assert result.end_reason == "laps_done"
    assert [lap.complete for lap in result.laps] == [True] * LAPS
    assert not any(lap.off_tracks or lap.crashes or lap.resets or lap.reversals for lap in result.laps)


@pytest.mark.parametrize(
    ("slug", "direction"), only([("oval", "ccw")], [(slug, way) for slug in TRACKS for way in ("ccw", "cw")])
)
def test_a_reference_is_faster_than_every_house_car(slug, direction):
    assert reference(slug, direction).time_ms < best_house_lap(slug, direction)


def test_a_reference_is_near_to_the_lap_of_its_line_without_lag():
    found = reference("oval", "ccw")
    track = by_slug("oval").geometry().in_direction("ccw")
    line = best_line(track, found.style.margin, found.style.shortness)
    ideal_s = line.lap_s(PADDOCK_CAR.max_speed)
    assert ideal_s * 0.98 <= found.time_ms / 1000 <= ideal_s * 1.06


def test_the_same_line_is_driven_the_same_way_again():
    ground = PreparedTrack(by_slug("oval").geometry(), "ccw")
    line = best_line(ground.track, 0.09)
    first, second = (drive_line(ground, line, DrivingStyle()) for _ in range(2))
    assert first is not None and second is not None
    assert first.trace.sha256 == second.trace.sha256


def test_a_reference_is_the_best_run_of_its_search():
    found = reference("oval", "ccw")
    ground = PreparedTrack(by_slug("oval").geometry(), "ccw")
    line = best_line(ground.track, DrivingStyle().margin, DrivingStyle().shortness, settled_m=1e-4)
    usual = drive_line(ground, line, DrivingStyle())
    assert usual is not None and found.runs > 20
    assert found.time_ms < min(lap.time_ms for lap in usual.laps)


def test_a_run_with_a_fault_is_none():
    ground = PreparedTrack(by_slug("oval").geometry(), "ccw")
    off_the_road = best_line(ground.track, -0.5, 3.0)
    assert drive_line(ground, off_the_road, DrivingStyle()) is None


@pytest.mark.parametrize("direction", only(["ccw"], ["ccw", "cw"]))
def test_an_open_track_is_driven_from_rest_in_every_lap(direction):
    found = drive_reference(bend(1.2), direction)
    assert found is not None
    times = [lap.time_ms for lap in found.result.laps]
    assert len(times) == LAPS and max(times) - min(times) < 30
    ideal_s = best_line(bend(1.2).in_direction(direction), found.style.margin, found.style.shortness).lap_s(4.0)
    assert found.time_ms / 1000 <= ideal_s * 1.15


def test_a_hairpin_that_the_car_cannot_turn_has_no_reference():
    assert drive_reference(bend(0.42), "ccw") is None


def test_commands_stay_within_the_car_s_actions():
    result = reference("oval", "ccw").result
    steering, speed = result.trace["steer"], result.trace["throttle"]
    assert np.abs(steering).max() <= CAR_SPACE.steering[1] and speed.max() <= CAR_SPACE.speed[1]
    assert speed.max() == pytest.approx(PADDOCK_CAR.max_speed, abs=0.01), "and use them"


def test_a_driver_finds_its_place_again_after_it_was_put_elsewhere():
    track = by_slug("oval").geometry().in_direction("ccw")
    line = best_line(track, 0.09)
    driver = LineDriver(line, DrivingStyle())
    for row in (0, 35, 70):
        (x, y), (dx, dy) = line.points[row], line.points[row + 1] - line.points[row - 1]
        yaw = math.atan2(dy, dx)
        back = -PADDOCK_CAR.rear_axle_x  # it is the rear axle that is on the line
        place = (x + back * math.cos(yaw), y + back * math.sin(yaw), yaw, 0.0)
        steering, _ = driver({"POSE": np.array(place)})
        assert abs(steering) < 0.7
