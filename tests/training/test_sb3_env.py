"""The adapter that comes with the package: stable-baselines3 learns on Paddock's cars without a line between."""

from __future__ import annotations

import math

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")

from stable_baselines3 import PPO, SAC
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecFrameStack

from paddock.simulator.envs.sb3 import SB3VecEnv, make_sb3_env

RACE = "Paddock/TimeTrial-v1"
CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 0.5, "high": 2}},
    "sensor": ["FRONT_FACING_CAMERA", "LIDAR"],
}


def test_it_learns_from_pictures_and_reports_episodes():
    cars = make_sb3_env(RACE, 2, observation="box", max_simulated_ms=1000, start="random")
    model = PPO("CnnPolicy", cars, n_steps=16, batch_size=16, n_epochs=1, seed=1).learn(32)
    assert len(model.ep_info_buffer) >= 2
    assert all(0 < episode["l"] <= 15 for episode in model.ep_info_buffer)
    assert all(episode["r"] > 0 for episode in model.ep_info_buffer)
    assert cars.env_is_wrapped(Monitor) == [True, True]
    rewards, lengths = evaluate_policy(model, cars, 2, return_episode_rewards=True)
    assert all(0 < length <= 15 for length in lengths) and min(rewards) > 0


def test_it_learns_from_several_sensors_and_continuous_actions():
    cars = make_sb3_env(RACE, 2, metadata=CONTINUOUS, max_simulated_ms=1000)
    model = SAC("MultiInputPolicy", cars, buffer_size=50, learning_starts=4, batch_size=4, seed=1).learn(8)
    assert model.num_timesteps >= 8
    assert {"FRONT_FACING_CAMERA", "LIDAR"} == set(model.get_env().reset())


def test_every_step_equals_the_vector_environments():
    options = {"start": "random", "max_simulated_ms": 400, "observation": "box"}
    cars = make_sb3_env(RACE, 3, seed=9, **options)
    plain = gymnasium.make_vec(RACE, num_envs=3, autoreset_mode="SameStep", **options)
    assert (cars.reset() == plain.reset(seed=9)[0]).all()
    for _ in range(9):
        actions = np.array([0, 5, 9])
        seen, rewards, done, infos = cars.step(actions)
        expected, earned, terminated, truncated, told = plain.step(actions)
        assert (seen == expected).all() and (rewards == earned.astype(np.float32)).all()
        assert (done == (terminated | truncated)).all()
        for number in np.flatnonzero(done):
            assert (infos[number]["terminal_observation"] == told["final_obs"][number]).all()
            assert infos[number]["TimeLimit.truncated"] == truncated[number]
            assert infos[number]["end_reason"] == told["final_info"]["end_reason"][number]


def test_a_returned_observation_does_not_change_later():
    cars = make_sb3_env(RACE, 1, observation="box")
    first = cars.reset()
    kept = first.copy()
    for _ in range(5):
        cars.step(np.array([9]))
    assert (first == kept).all()


class Pilot:
    """A reward function that remembers which way to steer: to the centre line a little ahead."""

    def __init__(self):
        self.action = 5

    def __call__(self, params):
        ahead = params["waypoints"][(params["closest_waypoints"][1] + 4) % len(params["waypoints"])]
        wanted = math.degrees(math.atan2(ahead[1] - params["y"], ahead[0] - params["x"])) - params["heading"]
        wanted = (wanted + 180.0) % 360.0 - 180.0
        self.action = 2 * min(range(5), key=lambda index: abs((-30, -15, 0, 15, 30)[index] - wanted)) + 1
        return 1.0


def test_finished_laps_truncate_the_episode():
    pilot = Pilot()
    cars = make_sb3_env(RACE, 1, reward_function=pilot)
    cars.reset()
    done = [False]
    while not done[0]:
        _, _, done, infos = cars.step(np.array([pilot.action]))
    assert (infos[0]["end_reason"], infos[0]["is_success"]) == ("laps_done", True)
    assert infos[0]["TimeLimit.truncated"]


def test_seeds_options_and_stacking_follow_stable_baselines3():
    cars = make_sb3_env(RACE, 2, start="random", render_mode="rgb_array", observation="box")
    cars.seed(4)
    first = cars.reset()
    cars.seed(4)
    assert (cars.reset() == first).all()
    assert (cars.reset() != first).any(), "another draw"
    cars.set_options({"start_m": 3.0})
    third = cars.reset()
    assert (third[0] == third[1]).all()
    cars.set_options([{"start_m": 3.0}, {"start_m": 4.0}])
    with pytest.raises(ValueError, match="same for all cars"):
        cars.reset()
    assert cars.render().shape[2] == 3
    stacked = VecFrameStack(make_sb3_env(RACE, 2, observation="box"), 4)
    assert stacked.reset().shape == (2, 120, 160, 4)


def test_unsupported_calls_say_so():
    with pytest.raises(ValueError, match='autoreset_mode="Disabled"'):
        SB3VecEnv(gymnasium.make_vec(RACE, num_envs=1))
    cars = make_sb3_env(RACE, 1)
    assert cars.has_attr("setting") and not cars.has_attr("no_such_thing")
    with pytest.raises(NotImplementedError, match="all cars share one environment"):
        cars.env_method("reset")
    with pytest.raises(NotImplementedError, match="all cars share one environment"):
        cars.set_attr("setting", None)
