import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import evaluation.simulator.envs
from evaluation.simulator.action import ActionSpace
from evaluation.simulator.envs import DEFAULT_METADATA, load_track
from evaluation.simulator.race import run_race
from evaluation.simulator.rules import RaceRules
from tests.shared import SHARED, needs_shared
from tracks.npy import write_npy

from .tracks_for_tests import stadium

TRACK = stadium()
CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 0.5, "high": 2}},
    "sensor": ["FRONT_FACING_CAMERA"],
}


def make(**options):
    options.setdefault("track", TRACK)
    return gymnasium.make("Paddock/TimeTrial-v1", **options)


LIDAR = {**CONTINUOUS, "sensor": ["LIDAR"]}


@pytest.mark.parametrize("metadata", [DEFAULT_METADATA, CONTINUOUS], ids=["discrete", "continuous"])
@pytest.mark.parametrize("start", ["fixed", "random"])
def test_it_passes_gymnasiums_own_check(metadata, start):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(metadata=metadata, start=start, render_mode="rgb_array").unwrapped)


def test_it_is_the_very_simulator_that_judges():
    """The same actions give the same states, judgements and times as a race."""
    actions = np.random.default_rng(3).integers(0, 10, 600)
    env = make(laps=2, max_resets=4).unwrapped
    env.reset(options={"start_m": 3.0})
    for action in (9, 9, 9, 3, 0, 0, 7) * 4:  # an episode before it leaves no mark
        env.step(action)
    env.reset()
    frames, statuses, done, taken = [], [], False, 0
    while not done:
        observation, _, terminated, truncated, info = env.step(int(actions[taken]))
        taken += 1
        frames.append(observation["FRONT_FACING_CAMERA"])
        statuses.append(info["status"])
        done = terminated or truncated

    asked = []

    def policy(readings):
        asked.append(readings["FRONT_FACING_CAMERA"])
        return np.eye(10, dtype=np.float32)[actions[len(asked) - 1]]

    space = ActionSpace.from_metadata(DEFAULT_METADATA)
    rules = RaceRules(laps=2, max_resets=4, max_simulated_ms=60_000)
    race = run_race(TRACK, rules, space, ["FRONT_FACING_CAMERA"], policy)
    assert len(asked) == taken
    assert all((a == b).all() for a, b in zip(frames[:-1], asked[1:], strict=True))
    assert info["laps"] == [lap.to_dict() for lap in race.laps]
    assert info["end_reason"] == race.end_reason
    assert statuses.count("off_track") == sum(lap.off_tracks for lap in race.laps)


def test_every_episode_is_as_the_first_to_the_last_bit():
    env = make(metadata=CONTINUOUS).unwrapped
    actions = np.random.default_rng(8).uniform(-1, 1, (60, 2)).astype(np.float32)

    def episode():
        env.reset(options={"start_m": 1.0})
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                break
        return env._drive.car.trace().sha256

    assert len({episode() for _ in range(4)}) == 1


def test_the_same_seed_gives_the_same_random_starts():
    env = make(start="random").unwrapped
    first = [env.reset(seed=5)[1]["progress"], *[env.reset()[0]["FRONT_FACING_CAMERA"].tobytes() for _ in range(3)]]
    second = [env.reset(seed=5)[1]["progress"], *[env.reset()[0]["FRONT_FACING_CAMERA"].tobytes() for _ in range(3)]]
    assert first == second
    assert len(set(first[1:])) == 3


def test_a_start_can_be_chosen():
    env = make().unwrapped
    a = env.reset(options={"start_m": 4.0})[0]["FRONT_FACING_CAMERA"]
    b = env.reset()[0]["FRONT_FACING_CAMERA"]
    assert (a != b).any()


def test_leaving_the_road_terminates_and_time_truncates():
    env = make().unwrapped
    env.reset()
    terminated = False
    while not terminated:  # straight on
        _, _, terminated, truncated, info = env.step(5)
        assert not truncated
    assert (info["end_reason"], info["is_success"]) == ("resets_used", False)

    env = make(max_simulated_ms=1000).unwrapped
    env.reset()
    outcomes = [env.step(4)[2:4] for _ in range(15)]
    assert outcomes[-1] == (False, True) and not any(any(pair) for pair in outcomes[:-1])


def test_the_reward_function_is_given_the_documented_params():
    seen = []

    def reward_function(params):
        seen.append(params)
        return params["speed"]

    env = make(reward_function=reward_function).unwrapped
    env.reset()
    _, reward, _, _, _ = env.step(9)
    assert reward == 1.5
    params = seen[0]
    documented = {
        "all_wheels_on_track": bool,
        "x": float,
        "y": float,
        "heading": float,
        "distance_from_center": float,
        "progress": float,
        "steps": int,
        "speed": float,
        "steering_angle": float,
        "track_width": float,
        "track_length": float,
        "waypoints": list,
        "closest_waypoints": list,
        "is_left_of_center": bool,
        "is_reversed": bool,
        "closest_objects": list,
        "objects_location": list,
        "objects_left_of_center": list,
        "objects_speed": list,
        "objects_heading": list,
        "objects_distance": list,
        "is_crashed": bool,
        "is_offtrack": bool,
    }
    assert {name: type(params[name]) for name in documented} == documented
    assert params["steering_angle"] == 30.0
    assert params["track_width"] == pytest.approx(1.0, abs=1e-6)
    assert params["closest_waypoints"] == [1, 2]


def test_the_default_reward_prefers_the_centre_line():
    env = make().unwrapped
    env.reset()
    assert env.step(5)[1] == 1.0


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_reward_that_is_not_finite_is_refused(value):
    env = make(reward_function=lambda params: value).unwrapped
    env.reset()
    with pytest.raises(ValueError, match="finite"):
        env.step(0)


@pytest.mark.parametrize(
    "bad", [{"start": "middle"}, {"direction": "up"}, {"render_mode": "human"}, {"laps": 0}, {"metadata": LIDAR}]
)
def test_wrong_arguments_are_refused(bad):
    with pytest.raises(ValueError):
        evaluation.simulator.envs.TimeTrialEnv(track=TRACK, **bad)


def test_a_track_is_a_geometry_a_slug_or_a_file(tmp_path):
    path = tmp_path / "mine.npy"
    path.write_bytes(write_npy(TRACK))
    assert load_track(path).fingerprint == load_track(str(path)).fingerprint == TRACK.fingerprint
    assert load_track("oval").length == pytest.approx(18.0, rel=0.01)
    with pytest.raises(ValueError, match="oval"):
        load_track("no-such-track")


@needs_shared
def test_it_opens_a_community_track():
    env = make(track=SHARED / "tracks" / "reInvent2019_wide.npy", direction="cw").unwrapped
    observation, _ = env.reset()
    assert observation["FRONT_FACING_CAMERA"].std() > 10
    assert env.track.direction == "cw"
