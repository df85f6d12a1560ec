"""The examples pass validation, say what they are, and reward what they claim to."""

from __future__ import annotations

import math

import pytest

from paddock.rules.race import RACE_TYPES
from paddock.simulator.rewards import avoid_objects, follow_centre_line
from training.rewards.examples import DEFAULT, EXAMPLES, example
from training.rewards.sandbox.function import load_reward
from training.rewards.trial_states import five_states
from training.rewards.validation import check_reward

STATES = [params for race_type in RACE_TYPES for params in five_states(race_type)]


def rewards(slug, *states):
    reward = load_reward(example(slug).code)
    return [reward(params) for params in states]


@pytest.mark.parametrize("one", EXAMPLES, ids=lambda one: one.slug)
def test_every_example_passes_validation_in_its_races(one):
    assert one.title
    assert one.explanation
    for race_type in one.race_types:
        report = check_reward(one.code, race_type=race_type)
        assert report.problems == []
        assert len(report.rewards) == 5


def test_the_direction_example_pays_half_for_a_heading_aside():
    state = five_states()[1]
    behind, ahead = (state["waypoints"][index] for index in state["closest_waypoints"])
    along = math.degrees(math.atan2(ahead[1] - behind[1], ahead[0] - behind[0]))
    straight, nearly, aside, backwards = rewards(
        "follow_direction", *({**state, "heading": along + turn} for turn in (0, 9, -11, 360 - 180))
    )
    assert straight == nearly == 2 * aside == 2 * backwards > 0.5


def test_every_known_sample_and_racing_have_an_example():
    assert [one.slug for one in EXAMPLES] == [
        "follow_centre_line",
        "stay_inside_borders",
        "prevent_zig_zag",
        "follow_direction",
        "stay_in_lane_without_crashing",
        "race",
    ]
    assert DEFAULT.slug == "follow_centre_line"
    with pytest.raises(KeyError):
        example("another")


def test_the_default_example_equals_the_environments_reward():
    middle = STATES[1]
    width = middle["track_width"]
    states = [{**middle, "distance_from_center": share * width} for share in (0, 0.1, 0.11, 0.25, 0.3, 0.5, 0.6)]
    assert rewards("follow_centre_line", *states, *STATES) == [follow_centre_line(one) for one in (*states, *STATES)]


def test_the_lane_example_equals_the_guides_for_objects():
    near = []
    for params in STATES:
        for x, y in params["objects_location"]:
            near += [
                {**params, "x": x + apart, "y": y, "is_left_of_center": left}
                for apart in (0.2, 0.4, 0.6, 1.0)
                for left in (True, False)
            ]
    states = [*STATES, *near, {**near[0], "is_crashed": True}]
    assert rewards("stay_in_lane_without_crashing", *states) == [pytest.approx(avoid_objects(one)) for one in states]


def test_the_borders_example_wants_all_wheels_5_cm_inside():
    inside = STATES[1]
    half = inside["track_width"] / 2
    assert rewards(
        "stay_inside_borders",
        inside,
        {**inside, "distance_from_center": half - 0.06},
        {**inside, "distance_from_center": half - 0.04},
        {**inside, "all_wheels_on_track": False},
    ) == [1.0, 1.0, 1e-3, 1e-3]


def test_the_zig_zag_example_takes_a_fifth_off_hard_steering():
    calm = {**STATES[1], "distance_from_center": 0.0}
    steering = [{**calm, "steering_angle": angle} for angle in (0.0, 15.0, -15.1, 30.0)]
    assert rewards("prevent_zig_zag", *steering) == [1.0, 1.0, 0.8, 0.8]


def test_the_racing_example_pays_for_metres_and_not_for_a_start():
    start = {**STATES[1], "distance_from_center": 0.0, "progress": 0.5, "steps": 2}
    length = start["track_length"]
    on = {**start, "progress": 1.5, "steps": 3}
    aside = {**start, "progress": 2.5, "steps": 4, "distance_from_center": start["track_width"] / 2 - 0.1}
    off = {**start, "progress": 3.0, "steps": 5, "is_offtrack": True}
    again = {**start, "progress": 0.5, "steps": 2}
    first, second, third, fourth, fifth = rewards("race", start, on, aside, off, again)
    assert first == pytest.approx(0.005 * length)
    assert second == pytest.approx(0.01 * length)
    assert third == pytest.approx(0.005 * length)
    assert (fourth, fifth) == (-1.0, 0.0)
