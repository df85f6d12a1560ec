"""The laboratory: the params along a recorded drive, what a function gives there, and its picture."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from paddock.simulator.envs import DEFAULT_METADATA
from paddock.simulator.envs.drive import Drive
from paddock.simulator.envs.setting import object_avoidance, time_trial
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.rewards import follow_centre_line
from paddock.simulator.sensors import POSE
from paddock.simulator.solids import box
from tests.paddock.simulator.tracks_for_tests import stadium
from training.rewards.examples import example
from training.rewards.laboratory.heat_map import (
    _DIVERGING,
    _VIRIDIS,
    CLASSES,
    class_of,
    colours_of,
    difference_map,
    differences,
    heat_map,
    number,
    scale_of,
)
from training.rewards.laboratory.recorded_lap import MAX_POINTS, params_along, record_lap, rewards_along

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def lap():
    return record_lap(stadium(), speed_mps=2.0)


def a_recorded_drive(setting, steps, swerve=()):
    """What a reward function really got in an environment, and the trace of the same drive; ``swerve``: steps with the
    wheel hard over."""
    given = []
    setting = setting(lambda params: given.append(params) or 1.0)
    drive = Drive(setting)
    drive.begin(np.random.default_rng(3), {"start_m": 0.0})
    pilot = CentreLinePilot(setting.ground.track)
    while steps and not drive.car.done:
        steps -= 1
        pose = drive.car.car.pose
        action = pilot({POSE: np.array([pose.x, pose.y, pose.yaw, drive.car.action.speed_mps])})
        if steps in swerve:
            action = np.array([1.0, 0.5], np.float32)
        drive.command(action)
        drive.stage.world.step()
        drive.judge()
    trace = drive.car.trace()
    drive.close()
    return given, trace, setting.ground.track


CONTINUOUS = {
    **DEFAULT_METADATA,
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 0.1, "high": 4.0}},
}


def assert_same(made, given):
    """The same to the last bit but for what is rounded in a trace: a pose there and back, and a time in ms."""
    assert made.keys() == given.keys()
    for key, value in given.items():
        if key == "sim_time" and given["progress"] == 100.0:
            assert abs(made[key] - value) <= 1 / 15  # over the line between two steps; a trace has the steps
        elif isinstance(value, float):
            assert made[key] == pytest.approx(value, abs=1e-9), key
        elif key in ("objects_location", "objects_distance", "objects_distance_from_center"):
            assert made[key] == [pytest.approx(part) for part in value], key
        else:
            assert made[key] == value, key


def test_params_along_a_trace_equal_those_of_the_training():
    given, trace, track = a_recorded_drive(
        lambda reward: time_trial(track=stadium(), metadata=CONTINUOUS, reward_function=reward, laps=2), 400
    )
    assert any(params["progress"] == 100.0 for params in given)
    made = params_along(track, trace.columns)
    # The trace's last row is the state before the next action; an ended drive has one more.
    assert abs(len(made) - len(given)) <= 1
    for mine, theirs in zip(made, given, strict=False):
        assert_same(mine, theirs)


def test_penalty_steps_are_left_out_as_in_training():
    given, trace, track = a_recorded_drive(
        lambda reward: time_trial(track=stadium(), metadata=CONTINUOUS, reward_function=reward, laps=1, max_resets=5),
        150,
        swerve=range(70, 110),
    )
    assert any(params["is_offtrack"] for params in given)
    made = params_along(track, trace.columns)
    assert abs(len(made) - len(given)) <= 1
    assert [params["is_offtrack"] for params in made] == [params["is_offtrack"] for params in given][: len(made)]
    for mine, theirs in zip(made, given, strict=False):
        assert mine["progress"] == pytest.approx(theirs["progress"])


def test_given_boxes_appear_in_the_params():
    given, trace, track = a_recorded_drive(
        lambda reward: object_avoidance(
            track=stadium(), metadata=CONTINUOUS, reward_function=reward, boxes=[(0.5, "outer")]
        ),
        30,
    )
    solid = box(*given[0]["objects_location"][0], track.lane_centre(0.5 * track.length, "outer")[2])
    made = params_along(track, trace.columns, solids=[solid])
    for mine, theirs in zip(made, given, strict=False):
        assert_same(mine, theirs)


def test_one_of_several_laps_can_be_chosen():
    _, trace, track = a_recorded_drive(
        lambda reward: time_trial(track=stadium(), metadata=CONTINUOUS, reward_function=reward, laps=3), 500
    )
    first, second = (params_along(track, trace.columns, episode=lap) for lap in (0, 1))
    assert first[0]["progress"] < 2
    assert first[-1]["progress"] > 95
    assert second[0]["progress"] < 2


def test_a_recorded_lap_is_complete_and_repeatable(lap):
    assert lap[-1]["progress"] == 100.0
    assert record_lap(stadium(), speed_mps=2.0) == lap
    assert record_lap(stadium(), "cw", speed_mps=2.0)[0]["is_reversed"] is True


def test_a_swaying_pilot_covers_the_width_of_the_road():
    track = stadium()
    swaying = record_lap(track, "cw", sway_m=0.3 * track.width_at(0.0))
    shares = [state["distance_from_center"] / state["track_width"] for state in swaying]
    assert swaying[-1]["progress"] == 100.0
    assert all(state["all_wheels_on_track"] for state in swaying)
    assert min(shares) < 0.05 and max(shares) > 0.25, "all three steps of the first example"


def test_the_number_of_points_is_limited(lap):
    trace = {name: [0.0] * (MAX_POINTS + 50) for name in ("yaw", "steer", "progress", "tstamp", "Y", "X")}
    count = MAX_POINTS + 50
    trace |= {"episode": [0] * count, "steps": [1] * count, "throttle": [1.0] * count}
    trace |= {"all_wheels_on_track": [True] * count, "episode_status": ["in_progress"] * count}
    assert len(params_along(stadium(), trace)) == MAX_POINTS


def test_rewards_along_a_lap_come_from_the_function(lap):
    along = rewards_along(example("follow_centre_line").code, lap)
    assert along.problems == []
    assert along.rewards == [follow_centre_line(params) for params in lap]


def test_a_function_keeps_its_memory_along_a_lap(lap):
    along = rewards_along("seen = []\ndef reward_function(params):\n    seen.append(1)\n    return len(seen)", lap)
    assert along.rewards == [float(number) for number in range(1, len(lap) + 1)]


def test_a_failing_call_has_no_reward(lap):
    along = rewards_along("def reward_function(params):\n    return 1 / (params['progress'] < 50)", lap)
    (problem,) = along.problems
    assert (problem.code, problem.line) == ("reward_raised", 2)
    assert [reward is None for reward in along.rewards] == [params["progress"] >= 50 for params in lap]


def test_a_function_that_cannot_load_has_no_rewards(lap):
    along = rewards_along("def reward_function(params)\n    return 1", lap)
    assert along.rewards == []
    assert [problem.code for problem in along.problems] == ["reward_syntax"]


# --- pictures


def strokes(svg, kind):
    return [path for path in ET.fromstring(svg).iter(f"{SVG}path") if path.get("class") == kind]


def texts(svg):
    return [text.text for text in ET.fromstring(svg).iter(f"{SVG}text")]


def test_a_heat_map_has_every_point_with_its_value_and_a_legend(lap):
    rewards = [params["progress"] for params in lap]
    svg = heat_map(stadium(), lap, rewards, label="<reward>", title="Lap & reward", scale=(0.0, 100.0))
    points = strokes(svg, "heat-point")
    assert len(points) == len(lap)
    told = [point.find(f"{SVG}title").text for point in points]
    assert told[10] == f"{lap[10]['projection_distance']:.1f} m: {number(rewards[10])}"
    assert texts(svg) == ["0", "50", "100", "<reward>"]
    assert ET.fromstring(svg).find(f"{SVG}title").text == "Lap & reward"
    colours = [path.get("stroke") for path in strokes(svg, "heat")]
    assert colours == colours_of(_VIRIDIS)  # progress only grows: each colour once, in order
    assert heat_map(stadium(), lap, rewards, scale=(0.0, 100.0)) == heat_map(
        stadium(), lap, rewards, scale=(0.0, 100.0)
    )


def test_a_point_without_a_reward_is_grey_and_dashed(lap):
    svg = heat_map(stadium(), lap, [1.0] * 20 + [None] * 10 + [1.0] * (len(lap) - 40))
    dashed = [path.get("stroke-dasharray") for path in strokes(svg, "heat")]
    assert dashed == [None, "1 4", None, "1 4"]


def test_a_difference_is_orange_where_the_second_gives_more(lap):
    count = len(lap)
    svg = difference_map(stadium(), lap, [1.0] * count, [2.0] * 30 + [1.0] * 30 + [0.5] * (count - 60))
    colours = colours_of(_DIVERGING)
    assert [path.get("stroke") for path in strokes(svg, "heat")] == [colours[-1], colours[10], colours[5]]
    assert texts(svg)[:3] == ["\N{MINUS SIGN}1", "0", "1"]


def test_differences_need_both_values():
    assert differences([1.0, None, 2.0], [3.0, 1.0]) == [2.0, None, None]


def test_a_map_is_drawn_without_any_reward(lap):
    svg = heat_map(stadium(), lap, [])
    assert texts(svg) == ["reward"]
    assert len(strokes(svg, "heat-point")) == len(lap)


@pytest.mark.parametrize(("reward", "said"), [(1.0, "1"), (0.0, "0"), (-0.5, "\N{MINUS SIGN}0.5")])
def test_a_constant_reward_has_a_legend_of_one_number(lap, reward, said):
    assert texts(heat_map(stadium(), lap, [reward] * len(lap))) == [said, "reward"]


def test_equal_rewards_show_a_difference_of_zero(lap):
    rewards = [1.0] * len(lap)
    assert texts(difference_map(stadium(), lap, rewards, rewards))[0] == "0"


def test_one_huge_reward_does_not_flatten_the_scale():
    assert scale_of([*(float(value) for value in range(100)), 1e5]) == (2.0, 98.0)
    assert scale_of([1.0, 1000.0]) == (1.0, 1000.0)
    assert scale_of([None]) == (0.0, 0.0)


def test_the_legend_tells_values_beyond_the_scale(lap):
    rewards = [1.0] * (len(lap) - 1) + [1000.0]
    assert texts(heat_map(stadium(), lap, rewards))[:2] == ["1", "≥ 1"]


def test_colours_run_from_dark_to_bright():
    def lightness(colour):
        red, green, blue = (int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5))
        return 0.2126 * red**2.2 + 0.7152 * green**2.2 + 0.0722 * blue**2.2

    steps = [lightness(colour) for colour in colours_of(_VIRIDIS)]
    assert steps == sorted(steps)
    spread = [lightness(colour) for colour in colours_of(_DIVERGING)]
    assert spread[: CLASSES // 2 + 1] == sorted(spread[: CLASSES // 2 + 1])
    assert spread[CLASSES // 2 :] == sorted(spread[CLASSES // 2 :], reverse=True)


@pytest.mark.parametrize(
    ("value", "scale", "wanted"),
    [
        *[(0.0, (0, 1), 0), (1.0, (0, 1), CLASSES - 1), (0.5, (0, 1), CLASSES // 2), (9, (0, 1), CLASSES - 1)],
        *[(-9, (0, 1), 0), (3, (3, 3), CLASSES // 2), (4, (3, 3), CLASSES - 1), (2, (3, 3), 0)],
    ],
)
def test_a_value_has_the_colour_of_its_share_of_the_scale(value, scale, wanted):
    assert class_of(value, scale) == wanted
