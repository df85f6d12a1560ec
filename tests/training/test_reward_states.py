"""The five states are what the real referee says of a car on a real track, with all keys in their known units."""

from __future__ import annotations

import math

import pytest

from paddock.rules.race import RACE_TYPES
from training.rewards.trial_states import STATES, five_states

NUMBER, PAIR = "number", "pair"
# deepracer-simapp, RewardParam, with the ranges of the developer guide; those of objects are checked apart.
KEYS = {
    "all_wheels_on_track": (bool, None),
    "x": (float, (-10, 10)),
    "y": (float, (-10, 10)),
    "heading": (float, (-180, 180)),
    "distance_from_center": (float, (0, 1)),
    "projection_distance": (float, (0, 18)),
    "progress": (float, (0, 100)),
    "steps": (int, (1, 1000)),
    "speed": (float, (0.1, 4)),
    "steering_angle": (float, (-30, 30)),
    "track_width": (float, (0.6, 1.5)),
    "track_length": (float, (17, 19)),
    "waypoints": (list, None),
    "closest_waypoints": (list, None),
    "is_left_of_center": (bool, None),
    "is_reversed": (bool, None),
    "closest_objects": (list, None),
    "objects_location": (list, None),
    "objects_left_of_center": (list, None),
    "object_in_camera": (bool, None),
    "objects_speed": (list, None),
    "objects_heading": (list, None),
    "objects_distance_from_center": (list, None),
    "objects_distance": (list, None),
    "is_crashed": (bool, None),
    "is_offtrack": (bool, None),
    "sim_time": (float, (0, 60)),
}


@pytest.mark.parametrize("race_type", RACE_TYPES)
def test_each_state_has_27_keys_of_the_right_type_and_range(race_type):
    assert len(KEYS) == 27
    for params in five_states(race_type):
        assert params.keys() == KEYS.keys()
        for name, (kind, bounds) in KEYS.items():
            assert type(params[name]) is kind, name
            assert bounds is None or bounds[0] <= params[name] <= bounds[1], (name, params[name])


@pytest.mark.parametrize("race_type", RACE_TYPES)
def test_each_state_is_what_its_name_says(race_type):
    states = dict(zip(STATES, five_states(race_type), strict=True))
    assert states["start"]["progress"] < 2
    assert 20 <= states["valid"]["progress"] < 21
    assert 60 <= states["progress"]["progress"] < 61
    assert states["finish"]["progress"] == 100.0
    assert [state["is_offtrack"] for state in states.values()] == [False, False, False, True, False]
    assert [state["all_wheels_on_track"] for state in states.values()] == [True, True, True, False, True]
    off = states["off_track"]
    assert off["distance_from_center"] > off["track_width"] / 2
    assert all(state["is_left_of_center"] for state in states.values())


def test_the_closest_waypoints_surround_the_car():
    for params in five_states():
        waypoints = params["waypoints"]
        assert all(type(point) is tuple and len(point) == 2 for point in waypoints)
        before, after = (waypoints[index] for index in params["closest_waypoints"])
        direction = math.atan2(after[1] - before[1], after[0] - before[0])
        assert abs(math.remainder(math.radians(params["heading"]) - direction, 2 * math.pi)) < 0.1
        nearest = min(math.dist(point, (params["x"], params["y"])) for point in waypoints)
        apart = math.dist(before, after)
        assert nearest <= math.hypot(params["distance_from_center"], apart)


@pytest.mark.parametrize(("race_type", "count", "speed"), [("object_avoidance", 2, 0.0), ("head_to_head", 1, 1.0)])
def test_races_with_objects_fill_every_object_list(race_type, count, speed):
    for params in five_states(race_type):
        for name in KEYS:
            if name.startswith("objects_"):
                assert len(params[name]) == count, name
        assert params["objects_speed"] == [speed] * count
        assert all(0 <= index < count for index in params["closest_objects"])
        assert all(type(place) is tuple for place in params["objects_location"])


def test_a_time_trial_has_no_objects():
    for params in five_states():
        assert params["objects_location"] == []
        assert params["closest_objects"] == [0, 0]
