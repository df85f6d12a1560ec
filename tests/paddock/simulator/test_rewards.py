"""The object keys of a reward function's params, and the guide's example for races with objects."""

import math

import pytest

from paddock.simulator.car import Pose
from paddock.simulator.rewards import Objects, avoid_objects, in_camera
from paddock.simulator.solids import box, car

from .tracks_for_tests import stadium

TRACK = stadium()


def at(distance, lane, make=box):
    return make(*TRACK.lane_centre(distance, lane))


def params_at(distance, solids, speed=1.25):
    return Objects(TRACK, speed).params(Pose(*TRACK.point_at(distance)), distance, solids)


def test_without_objects_every_key_has_its_default():
    first = params_at(1.0, [])
    assert first == {
        "closest_objects": [0, 0],
        "objects_location": [],
        "objects_left_of_center": [],
        "object_in_camera": False,
        "objects_speed": [],
        "objects_heading": [],
        "objects_distance_from_center": [],
        "objects_distance": [],
    }
    first["objects_speed"].append(1)  # a reward function may do what it likes with its params
    assert params_at(1.0, [])["objects_speed"] == []


def test_each_list_has_one_entry_per_object_in_order():
    solids = [at(9.0, "outer"), at(2.0, "inner"), at(5.0, "inner", car)]
    params = params_at(3.0, solids)
    assert params["objects_location"] == [(solid.x, solid.y) for solid in solids]
    assert params["objects_left_of_center"] == [False, True, True]
    assert params["objects_speed"] == [0.0, 0.0, 1.25]
    assert params["objects_heading"] == [0.0, 0.0, solids[2].yaw]  # radians
    assert params["objects_distance"] == pytest.approx([9.0, 2.0, 5.0], abs=0.01)
    assert params["objects_distance_from_center"] == pytest.approx([0.25] * 3, abs=0.01)


@pytest.mark.parametrize(
    ("distance", "closest"), [(1.0, [0, 1]), (2.5, [1, 2]), (6.0, [2, 0]), (9.5, [0, 1]), (0.1, [0, 1])]
)
def test_the_closest_objects_are_the_nearest_behind_and_ahead(distance, closest):
    solids = [at(9.0, "outer"), at(2.0, "inner"), at(5.0, "inner")]
    assert params_at(distance, solids)["closest_objects"] == closest


def test_a_single_object_is_both_behind_and_ahead():
    assert params_at(3.0, [at(2.0, "inner")])["closest_objects"] == [0, 0]


def test_on_a_clockwise_track_left_is_outside():
    track = TRACK.in_direction("cw")
    params = Objects(track).params(Pose(*track.point_at(0.0)), 0.0, [box(*track.lane_centre(3.0, "outer"))])
    assert params["objects_left_of_center"] == [True]


def test_moving_objects_are_tracked_and_standing_ones_stay():
    objects = Objects(TRACK, 1.0)
    seen = []
    for step in range(250):
        solids = [at(2.0, "inner"), at(0.1 * step, "outer", car)]
        seen.append(objects.params(Pose(*TRACK.point_at(0.0)), 0.0, solids)["objects_distance"])
    assert {standing for standing, _ in seen} == {seen[0][0]}
    for step, (_, moving) in enumerate(seen):
        apart = moving - 0.1 * step
        assert abs(math.remainder(apart, TRACK.length)) < 0.02


@pytest.mark.parametrize(
    ("x", "y", "seen"),
    [(1.0, 0.0, True), (3.0, 1.0, True), (-1.0, 0.0, False), (0.5, 2.0, False), (0.2, 0.0, False)],
)
def test_an_object_in_view_counts_as_seen(x, y, seen):
    """A box before the bumper is too near: its floor is below the picture."""
    for yaw in (0.0, 2.2):
        pose = Pose(4.0, -3.0, yaw)
        assert in_camera(pose, box(*pose.ahead(x, y), yaw)) is seen


def test_only_the_object_ahead_counts_as_seen():
    behind_the_bend = [at(1.0, "inner"), at(9.0, "inner")]
    assert params_at(0.0, behind_the_bend)["object_in_camera"] is True
    assert params_at(2.0, behind_the_bend)["object_in_camera"] is False


def reward(distance, *, lane="inner", crashed=False, wheels=True):
    """Of a car left of the centre line with an object so far ahead."""
    solids = [at(4.0, lane)]
    x, y, _ = TRACK.point_at(4.0 - distance, 0.25)
    return avoid_objects(
        {
            **params_at(4.0 - distance, solids),
            "x": x,
            "y": y,
            "all_wheels_on_track": wheels,
            "track_width": 1.0,
            "distance_from_center": 0.25,
            "is_left_of_center": True,
            "is_crashed": crashed,
        }
    )


def test_the_example_keeps_away_from_the_next_object_in_its_lane():
    rewards = [reward(distance) for distance in (1.2, 0.7, 0.4, 0.2)]
    assert rewards == [5.0, 3.0, pytest.approx(1.8), pytest.approx(1.004)]
    assert reward(0.4, lane="outer") == 5.0
    assert reward(1.2, crashed=True) == pytest.approx(1.004)
    assert reward(1.2, wheels=False) == pytest.approx(4.001)
