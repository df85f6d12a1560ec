"""What an environment takes as an action, and what it says to anything else."""

import gymnasium
import numpy as np
import pytest

import paddock.simulator.envs  # noqa: F401  registers the environments
from paddock.errors import UserFault

from .test_envs import CONTINUOUS, TRACK, make


def begun(**options):
    env = make(**options).unwrapped
    env.reset(seed=1)
    return env


def begun_cars(**options):
    cars = gymnasium.make_vec("Paddock/TimeTrial-v1", num_envs=2, track=TRACK, **options)
    cars.reset(seed=1)
    return cars


@pytest.mark.parametrize("action", [-1, 10, 99, 3.7, float("nan"), "3", None, True, np.array([1, 2]), np.array([])])
def test_an_unknown_action_is_refused_and_moves_nothing(action):
    env = begun()
    with pytest.raises(ValueError, match="an action must be a whole number from 0 to 9, not"):
        env.step(action)
    assert env.step(4)[4]["time_ms"] == 67


@pytest.mark.parametrize("action", [np.array([3]), np.array([[3]]), np.int64(3), np.array(3), 3.0, [3]])
def test_an_action_may_be_any_single_integer(action):
    plain, other = begun(), begun()
    for _ in range(5):
        expected, got = plain.step(3), other.step(action)
    assert (expected[0]["FRONT_FACING_CAMERA"] == got[0]["FRONT_FACING_CAMERA"]).all()
    assert expected[1:] == got[1:]


@pytest.mark.parametrize("action", [0.5, [0.1], [0.1, 0.2, 0.3], "left", None])
def test_a_continuous_action_must_be_two_numbers(action):
    with pytest.raises(ValueError, match="an action must be two numbers in"):
        begun(metadata=CONTINUOUS).step(action)


def test_a_non_finite_action_is_refused_as_in_a_race():
    with pytest.raises(UserFault) as fault:
        begun(metadata=CONTINUOUS).step(np.array([np.nan, 0.0], np.float32))
    assert fault.value.code == "non_finite_action"


@pytest.mark.parametrize(
    ("actions", "said"),
    [
        (np.array([3]), "2 cars need an array of as many actions, one for each, not 1"),
        (np.array([3, 3, 3]), "2 cars need an array of as many actions, one for each, not 3"),
        (3, "2 cars need an array of as many actions, one for each, not none"),
        (None, "2 cars need an array of as many actions, one for each, not none"),
        (np.array([3, -1]), "car 1: an action must be a whole number from 0 to 9, not"),
        (np.array([99, 0]), "car 0: an action must be a whole number from 0 to 9, not"),
    ],
)
def test_a_refused_action_moves_none_of_many_cars(actions, said):
    cars = begun_cars()
    with pytest.raises(ValueError, match=said):
        cars.step(actions)
    infos = cars.step(np.array([[4], [4]]))[4]
    assert infos["time_ms"].tolist() == [67, 67]


def test_a_step_after_the_end_demands_a_reset():
    env = begun(max_simulated_ms=100)
    while not any(env.step(4)[2:4]):
        pass
    with pytest.raises(gymnasium.error.ResetNeeded, match="the episode is over"):
        env.step(4)
    env.reset()
    env.step(4)
