"""Telemetry of a lap against the run that it comes from."""

import math

import numpy as np
import pytest

from paddock.analysis.telemetry import DrivenTrace, excursions, lap_line, lap_telemetry, start_of
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from tests.paddock.analysis.mistakes import drive, good_lap, telemetry_of, track_named

SLUG = "oval-track"
HEADER = "episode,steps,X,Y,yaw,steer,throttle,all_wheels_on_track,progress,tstamp,episode_status"


def test_a_lap_ends_with_its_time():
    lap = good_lap(SLUG)
    assert lap.ms[0] == 0.0
    assert lap.ms[-1] == lap.time_ms
    assert (np.diff(lap.ms) >= 0).all()


def test_the_driven_speed_follows_the_commanded_one_with_the_cars_gain():
    lap = good_lap(SLUG)
    steady = np.abs(lap.speed - 2.0) < 1e-6
    assert np.median(lap.driven_speed[steady]) == pytest.approx(2.0 * PADDOCK_CAR.speed_gain, rel=0.01)


def test_the_driven_speed_gives_the_way():
    lap = good_lap(SLUG)
    way = float((lap.driven_speed[1:] + lap.driven_speed[:-1]).dot(np.diff(lap.ms)) / 2000)
    assert way == pytest.approx(track_named(SLUG)[0].length, rel=0.03)  # along the centre line


def test_the_curvature_of_a_lap_is_one_turn():
    lap = good_lap(SLUG)
    ways = (lap.driven_speed[1:] + lap.driven_speed[:-1]) / 2000 * np.diff(lap.ms)
    turned = float(((lap.curvature[1:] + lap.curvature[:-1]) / 2).dot(ways))
    assert turned == pytest.approx(2 * math.pi, rel=0.05)
    assert lap.driven_steer == pytest.approx(np.degrees(np.arctan(lap.curvature * 0.285)), abs=0.3)


def test_the_offset_is_to_the_left_of_the_centre_line():
    track, _ = track_named(SLUG)
    pilot = CentreLinePilot(track, track.direction, 1.5, offset=0.2)
    run = run_race(RaceSettings(track, RaceRules(laps=1), [Entrant(pilot.action_space, pilot.sensors, pilot)]))
    assert float(np.median(telemetry_of(SLUG, run, 1).offset)) == pytest.approx(0.2, abs=0.08)


@pytest.mark.parametrize("start_m", [0.0, 6.5])
def test_laps_begin_at_their_line(start_m):
    track, _ = track_named(SLUG)
    pilot = CentreLinePilot(track, track.direction, 2.0)
    entrant = Entrant(pilot.action_space, pilot.sensors, pilot)
    run = run_race(RaceSettings(track, RaceRules(laps=1), [entrant], start_m=start_m))
    assert start_of(DrivenTrace.of(run.trace.to_csv()), track) == pytest.approx(start_m, abs=0.02)


def test_an_evaluated_run_has_no_reward():
    assert good_lap(SLUG).reward is None


def test_a_trace_with_rewards_has_their_channel():
    run = drive(SLUG)
    run.trace.columns["reward"][:] = 2.5
    lap = telemetry_of(SLUG, run)
    assert lap.reward == pytest.approx(np.full(len(lap.metres), 2.5))


def trace(*rows) -> DrivenTrace:
    """Rows of (percent, seconds, on the road, status), on a straight line."""
    lines = [
        f"0,{index},{percent / 10},0,0,0,1.0,{on_road},{percent},{seconds},{status}"
        for index, (percent, seconds, on_road, status) in enumerate(rows)
    ]
    return DrivenTrace.of("\n".join((HEADER, *lines)).encode())


LAP = {"number": 1, "start_ms": 0, "time_ms": 12_000, "complete": True}


def test_where_a_car_left_the_road():
    driven = trace(
        (10, 1, True, "in_progress"),
        (20, 2, False, "in_progress"),
        (30, 3, False, "off_track"),
        (25, 5, True, "pause"),
        (40, 6, True, "in_progress"),
        (50, 7, False, "in_progress"),
        (60, 8, True, "in_progress"),
    )
    found = excursions(driven, 10.0)
    assert [(each.from_m, each.to_m, each.ms, each.reset) for each in found] == [
        (2.0, 3.0, 2000, True),
        (5.0, 5.0, 7000, False),
    ]


def test_a_car_that_was_put_back_has_no_speed_from_its_jump():
    driven = trace((10, 1, True, "in_progress"), (30, 1.066, True, "pause"), (31, 1.13, True, "in_progress"))
    assert driven.driven_speed[0] == 0.0
    short = trace((10, 1, False, "off_track"), (12, 1.066, True, "pause"), (12, 4, True, "pause"))
    assert not short.driven_speed.any(), "not even where it was put back near by"


def test_a_lap_ends_where_the_car_stopped():
    driven = trace((0, 0, True, "prepare"), (40, 5, True, "in_progress"))
    line = lap_line(driven, [LAP | {"complete": False}], 1)
    lap = lap_telemetry(driven, line, by_slug("straight-track").geometry())
    assert lap.reached_m == pytest.approx(0.4 * lap.metres[-1], abs=0.1)
    assert np.isnan(lap.ms[-1]) and np.isnan(lap.speed[-1])


def test_a_lap_without_steps_has_no_line():
    driven = trace((0, 0, True, "prepare"), (40, 5, True, "in_progress"))
    assert lap_line(driven, [LAP | {"number": 2}], 2) is None
    assert lap_line(driven, [LAP], 3) is None
