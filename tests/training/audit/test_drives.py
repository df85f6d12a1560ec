"""The eight recorded drives are what they are called, by the verdict of another referee and by their own states."""

from __future__ import annotations

import json
import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import OBJECT_AVOIDANCE, TIME_TRIAL, RaceRules
from paddock.simulator.car import Pose
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.referee import Referee
from training.rewards.audit.drives import (
    CIRCLES,
    CRASH,
    CUTTING,
    DRIVES,
    FAST,
    OFF_LINE,
    SLOW,
    STANDING,
    ZIG_ZAG,
    eight_drives,
)
from training.rewards.sandbox.function import from_wire, to_wire

from .driven import driven as kept

TRACKS = [("oval", "ccw"), ("reinvent-2018", "cw")]
LAPS = (FAST, SLOW, OFF_LINE, ZIG_ZAG, CUTTING)


@cache
def track_named(slug):
    return next(entry for entry in CATALOGUE if entry.slug == slug).geometry()


@pytest.fixture(params=TRACKS, ids=lambda place: "-".join(place))
def place(request):
    slug, direction = request.param
    return track_named(slug), direction


@cache
def driven(*place):
    return {drive.name: drive for drive in kept(*place)}


@pytest.fixture
def drives(place):
    return driven(*place)


def judged_again(drive, track, direction):
    """A new referee that sees the poses of the drive only, from the places in the params."""
    referee = Referee(track.in_direction(direction), RaceRules.of_an_episode(direction=direction), PADDOCK_CAR)
    for state in drive.states:
        yaw = math.radians(state["heading"])
        nose = PADDOCK_CAR.nose_x
        assert not referee.done, drive.name
        referee.judge(Pose(state["x"] - nose * math.cos(yaw), state["y"] - nose * math.sin(yaw), yaw))
    return referee


def test_another_referee_comes_to_the_same_verdict_on_each_drive(place, drives):
    track, direction = place
    assert tuple(drives) == DRIVES
    for drive in drives.values():
        referee = judged_again(drive, track, direction)
        assert referee.done, drive.name
        assert referee.status == drive.ended, drive.name
        lap = referee.laps[0]
        if drive.lap_ms is None:
            assert lap.end_ms is None, drive.name
        else:
            assert lap.end_ms - lap.start_ms == pytest.approx(drive.lap_ms, abs=1), drive.name
        assert referee.percent == pytest.approx(drive.progress, abs=0.01), drive.name


def test_laps_are_laps_and_the_other_three_are_none(drives):
    assert {name for name, drive in drives.items() if drive.lap_ms is not None} == set(LAPS)
    assert drives[CRASH].ended == "off_track"
    assert drives[STANDING].ended == "time_up"
    assert drives[CIRCLES].ended in ("off_track", "reversed")


def test_the_fast_and_the_slow_lap_differ_in_speed_alone(drives):
    fast, slow = drives[FAST], drives[SLOW]
    assert slow.lap_ms > 1.3 * fast.lap_ms
    for drive in (fast, slow):
        assert drive.is_clean
        assert np.mean([state["distance_from_center"] for state in drive.states]) < 0.08


def test_off_the_line_stays_on_the_road_and_away_from_the_centre(drives):
    drive = drives[OFF_LINE]
    assert drive.is_clean
    assert np.mean([state["distance_from_center"] for state in drive.states]) > 0.15


def wheel_work(drive):
    """Degrees that the wheels turn in a step."""
    return np.abs(np.diff([state["steering_angle"] for state in drive.states])).mean()


def test_the_zig_zag_changes_sides_and_steers_hard(drives):
    states = drives[ZIG_ZAG].states
    assert drives[ZIG_ZAG].is_clean
    sides = [state["is_left_of_center"] for state in states]
    assert sum(a != b for a, b in pairwise(sides)) >= 8
    assert wheel_work(drives[ZIG_ZAG]) > 2 * wheel_work(drives[SLOW])


def test_the_cutting_lap_is_the_quickest_and_hangs_wheels_over_the_border(drives):
    drive = drives[CUTTING]
    assert drive.lap_ms < drives[FAST].lap_ms
    assert not drive.is_clean
    assert not any(state["is_offtrack"] for state in drive.states)


def test_standing_still_is_the_slowest_speed_there_is(drives):
    drive = drives[STANDING]
    assert max(state["speed"] for state in drive.states) == pytest.approx(PADDOCK_CAR.min_speed)
    assert drive.progress_per_second < drives[SLOW].progress_per_second / 5
    assert len(drive.states) == 900  # 60 s


def test_circles_turn_round_and_gain_nothing_while_they_do(drives):
    states = drives[CIRCLES].states
    turning = [state for state in states if state["steering_angle"] == pytest.approx(30.0)]
    turned = np.ptp(np.unwrap([math.radians(state["heading"]) for state in turning]))
    assert turned > math.radians(60)
    assert turning[-1]["progress"] - turning[0]["progress"] < 10


def test_circles_turn_back_where_the_road_is_wide():
    drive = driven(track_named("oval"), "ccw")[CIRCLES]
    turned = np.ptp(np.unwrap([math.radians(state["heading"]) for state in drive.states]))
    assert turned > math.radians(150)


def test_with_objects_the_crash_is_into_a_box_and_the_laps_pass_both():
    drives = driven(track_named("oval"), "ccw", OBJECT_AVOIDANCE)
    assert drives[CRASH].ended == "crashed"
    assert drives[CRASH].states[-1]["is_crashed"]
    for name in LAPS:
        assert drives[name].lap_ms is not None, name
        assert len(drives[name].states[0]["objects_location"]) == 2


def test_the_drives_are_the_same_every_time():
    place = (track_named("oval"), "ccw", TIME_TRIAL)
    assert eight_drives(*place) == kept(*place)


def test_the_drives_reach_the_sandbox_unchanged_and_fit_into_a_message():
    longest = eight_drives(track_named("h-track"), "ccw", OBJECT_AVOIDANCE)
    states = [state for drive in longest for state in drive.states]
    text = json.dumps(to_wire(states))
    assert len(text) < 3 * 1024 * 1024  # a message has 4 MB
    assert from_wire(json.loads(text)) == states
