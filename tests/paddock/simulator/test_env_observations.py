"""An environment with one sensor gives its picture itself, as wrappers and learners of single pictures want it."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import GrayscaleObservation, ResizeObservation

from paddock.simulator.envs import DEFAULT_METADATA

from .test_envs import STEREO, TRACK, make

CAMERA = "FRONT_FACING_CAMERA"
PAIR = {**DEFAULT_METADATA, "sensor": ["STEREO_CAMERAS"]}


def make_cars(**options):
    return gymnasium.make_vec("Paddock/TimeTrial-v1", num_envs=2, track=TRACK, **options)


@pytest.mark.parametrize(
    ("observation", "metadata", "channels"),
    [("box", DEFAULT_METADATA, 1), ("box", PAIR, 2), ("rgb", DEFAULT_METADATA, 3)],
)
def test_a_single_sensor_can_be_the_observation_itself(observation, metadata, channels):
    env = make(observation=observation, metadata=metadata, render_mode="rgb_array").unwrapped
    check_env(env)
    assert env.observation_space == gymnasium.spaces.Box(0, 255, (120, 160, channels), np.uint8)
    usual = make(metadata=metadata)
    env.reset(seed=4), usual.reset(seed=4)
    for _ in range(4):
        picture, frame = env.step(7)[0], usual.step(7)[0][metadata["sensor"][0]]
    assert (picture == frame).all()
    assert env.render().shape == (120, 160, 3)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("observation", ["box", "rgb"])
def test_many_cars_give_the_same_pictures_as_one(observation, mode):
    cars = make_cars(observation=observation, autoreset_mode=mode, max_simulated_ms=200)
    one = make(observation=observation, max_simulated_ms=200)
    first, begun = cars.reset(seed=3)[0], one.reset(seed=3)[0]
    assert first.shape == (2, *one.observation_space.shape) and cars.observation_space.contains(first)
    assert (first[0] == begun).all()
    over = False
    while not over:
        seen, _, _, truncated, infos = cars.step(np.array([5, 5]))
        last, _, _, over, _ = one.step(5)
    assert truncated.all()
    kept = infos["final_obs"][0] if mode == "SameStep" else seen[0]
    assert (kept == last).all()


def test_gymnasiums_picture_wrappers_accept_it():
    grey = GrayscaleObservation(make(observation="rgb"), keep_dim=True)
    small = ResizeObservation(make(observation="box"), (60, 80))
    smaller_grey = ResizeObservation(GrayscaleObservation(make(observation="rgb")), (60, 80))
    plain = make(observation="box").reset(seed=2)[0]
    # Gymnasium weighs the three channels and cuts off: at most one level below the camera's own grey
    difference = plain.astype(int) - grey.reset(seed=2)[0]
    assert difference.min() >= 0 and difference.max() <= 1
    assert small.reset(seed=2)[0].shape == (60, 80, 1)
    assert smaller_grey.reset(seed=2)[0].shape == (60, 80)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"observation": "picture"}, "observation must be 'dict', 'box' or 'rgb', not 'picture'"),
        ({"observation": "box", "metadata": STEREO}, "needs a car with one sensor, this one has STEREO_CAMERAS, LIDAR"),
        ({"observation": "rgb", "metadata": PAIR}, "needs a sensor with one channel, STEREO_CAMERAS has 2"),
    ],
)
@pytest.mark.parametrize("maker", [make, make_cars])
def test_a_car_without_a_single_picture_is_refused(maker, options, said):
    with pytest.raises(ValueError, match=said):
        maker(**options)


def test_infos_may_be_numbers_only():
    cars = make_cars(autoreset_mode="SameStep", max_simulated_ms=200, numbers_only=True)
    infos = cars.reset(seed=1)[1]
    while "final_info" not in infos:
        infos = cars.step(np.array([5, 5]))[4]
    for told in (infos, infos["final_info"]):
        values = [array for key, array in told.items() if isinstance(array, np.ndarray) and key != "final_obs"]
        assert len(values) > 5 and all(array.dtype.kind in "bif" for array in values)


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_torchrl_wraps_many_cars(mode):
    gym = pytest.importorskip("torchrl.envs.libs.gym", reason="torchrl is not installed: pip install torchrl")
    wrapped = gym.GymWrapper(make_cars(autoreset_mode=mode, max_simulated_ms=1000, numbers_only=True))
    wrapped.set_seed(3)
    driven = wrapped.rollout(40, break_when_any_done=False)
    assert driven.batch_size == (2, 40)
    assert driven["next", "truncated"].sum() >= 4 or driven["next", "done"].sum() >= 4
    assert driven["next", CAMERA].shape == (2, 40, 120, 160, 1)
