"""Many cars in one world are, to the last bit, as many single environments."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import paddock.simulator.envs  # noqa: F401  registers the environments
from paddock.simulator.car import Pose
from paddock.simulator.world import World
from tests.soak import one_of_each

from .tracks_for_tests import stadium

TRACK = stadium()
ALL = ("TimeTrial", "ObjectAvoidance", "HeadToHead")
OPTIONS = {
    "TimeTrial": {},
    "ObjectAvoidance": {"random_boxes": 2},
    "HeadToHead": {"bots": 2, "bot_speed_mps": 1.0, "bot_lane_changes": True},
}
STEREO_AND_LIDAR = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 0.5, "high": 2}},
    "sensor": ["STEREO_CAMERAS", "LIDAR"],
}


def options_of(kind, **more):
    return {"track": TRACK, "start": "random", "max_simulated_ms": 3000, **OPTIONS[kind], **more}


def vector(kind="TimeTrial", count=8, autoreset_mode="NextStep", **more):
    return gymnasium.make_vec(
        f"Paddock/{kind}-v1", num_envs=count, autoreset_mode=autoreset_mode, **options_of(kind, **more)
    )


def singles(kind="TimeTrial", count=8, autoreset_mode="NextStep", **more):
    def make():
        return gymnasium.make(f"Paddock/{kind}-v1", disable_env_checker=True, **options_of(kind, **more))

    return SyncVectorEnv([make] * count, autoreset_mode=autoreset_mode)


def assert_same(ours, theirs, where=""):
    """Equal to the last bit, whatever is nested in it."""
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys(), where
        for key in theirs:
            assert_same(ours[key], theirs[key], f"{where}.{key}")
    elif isinstance(theirs, np.ndarray) and theirs.dtype == object:
        for number, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            assert_same(a, b, f"{where}[{number}]")
    elif isinstance(theirs, np.ndarray):
        assert ours.dtype == theirs.dtype and ours.shape == theirs.shape, where
        assert ours.tobytes() == theirs.tobytes(), where
    elif isinstance(theirs, tuple):
        for number, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            assert_same(a, b, f"{where}({number})")
    else:
        assert ours == theirs, where


def compare(kind, steps, **more):
    ours, theirs = vector(kind, **more), singles(kind, **more)
    assert ours.single_observation_space == theirs.single_observation_space
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert_same(ours.reset(seed=11), theirs.reset(seed=11), "reset")
    ours.action_space.seed(4)
    ends = 0
    for step in range(steps):
        actions = ours.action_space.sample()
        result = ours.step(actions)
        assert_same(result, theirs.step(actions), f"step {step}")
        ends += int((result[2] | result[3]).sum())
    ours.close()
    theirs.close()
    return ends


@pytest.mark.parametrize(
    ("kind", "mode"),
    one_of_each([(kind, mode) for mode in ("NextStep", "SameStep") for kind in ALL], kind=lambda case: case[1]),
)
def test_eight_cars_equal_eight_environments(kind, mode):
    """Episodes end at different steps, so cars begin anew while others drive on."""
    assert compare(kind, 80, autoreset_mode=mode) >= 8


@pytest.mark.parametrize("kind", ALL)
def test_a_penalty_delays_only_the_car_that_has_it(kind):
    compare(kind, 60, count=4, max_resets=5, off_track_penalty_ms=500)


def test_other_actions_and_sensors_equal_single_environments():
    compare("ObjectAvoidance", 50, count=4, metadata=STEREO_AND_LIDAR)


@pytest.mark.slow
def test_many_episodes_from_a_fixed_start_stay_equal():
    """A car that is put where it was before is where old contacts would be kept."""
    assert compare("TimeTrial", 600, start="fixed", max_simulated_ms=400, count=3) > 150


def test_all_cars_share_one_world_without_touching():
    env = vector(count=5)
    env.reset(seed=1)
    worlds = {id(drive.stage.world) for drive in env.unwrapped._drives}
    assert len(worlds) == 1
    assert len(env.unwrapped._world.cars) == 5
    env.step(env.action_space.sample())
    assert len(env.unwrapped._world.cars) == 5


def test_the_caller_may_reset_some_of_the_cars():
    ours, theirs = vector(count=3, autoreset_mode="Disabled"), singles(count=3, autoreset_mode="Disabled")
    assert_same(ours.reset(seed=[5, 6, 7]), theirs.reset(seed=[5, 6, 7]))
    for _ in range(5):
        actions = np.array([0, 4, 9])
        assert_same(ours.step(actions), theirs.step(actions))
    mask = np.array([False, True, True])
    ours_seen, _ = ours.reset(seed=[1, 2, 3], options={"reset_mask": mask.copy()})
    theirs_seen, _ = theirs.reset(seed=[1, 2, 3], options={"reset_mask": mask.copy()})
    assert_same(ours_seen, theirs_seen)
    for _ in range(5):
        actions = np.array([0, 4, 9])
        assert_same(ours.step(actions), theirs.step(actions))


def test_without_autoreset_a_finished_car_must_be_reset():
    env = vector(count=2, autoreset_mode="Disabled", max_simulated_ms=200)
    env.reset(seed=0)
    for _ in range(3):
        env.step(np.array([4, 5]))
    with pytest.raises(gymnasium.error.ResetNeeded, match="0, 1"):
        env.step(np.array([4, 5]))


def test_without_copies_the_same_arrays_are_reused():
    env = vector(count=2, copy=False)
    first, _ = env.reset(seed=0)
    second = env.step(np.array([0, 1]))[0]
    assert first is second
    copied = vector(count=2)
    first, _ = copied.reset(seed=0)
    before = first["FRONT_FACING_CAMERA"].copy()
    copied.step(np.array([0, 1]))
    assert (first["FRONT_FACING_CAMERA"] == before).all()


def test_it_renders_a_frame_per_car():
    env = vector(count=2, render_mode="rgb_array")
    assert env.render() is None
    env.reset(seed=0)
    assert [frame.shape for frame in env.render()] == [(120, 160, 3)] * 2
    env.close()


def test_each_car_may_have_its_own_reward_function():
    env = vector(count=3, reward_function=[lambda params, car=car: car + 0.5 for car in range(3)])
    env.reset(seed=0)
    assert env.step(np.array([4, 4, 4]))[1].tolist() == [0.5, 1.5, 2.5]
    with pytest.raises(ValueError, match="3 cars"):
        vector(count=3, reward_function=[lambda params: 0.0])


def test_it_must_be_reset_before_stepping():
    with pytest.raises(gymnasium.error.ResetNeeded):
        vector(count=2).step(np.array([0, 1]))


@pytest.mark.parametrize(
    "bad", [{"count": 0}, {"autoreset_mode": "Sometimes"}, {"render_mode": "human"}, {"start": "middle"}]
)
def test_wrong_arguments_are_refused(bad):
    with pytest.raises(ValueError):
        vector(**{"count": 2, **bad})


@pytest.mark.parametrize("mask", [[True, False], np.array([1, 0]), np.array([True]), np.array([False, False])])
def test_an_invalid_reset_mask_is_refused(mask):
    env = vector(count=2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": mask})


def test_there_must_be_one_seed_per_car():
    with pytest.raises(ValueError, match="2 cars"):
        vector(count=2).reset(seed=[1, 2, 3])


def test_the_autoreset_mode_is_in_the_metadata():
    assert vector(count=1).metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


# --- the car that serves again -------------------------------------------------------------------------------------


def driven(car, world, steps, start):
    car.place(start)
    poses = []
    for step in range(steps):
        car.command(30.0 - 7 * step % 60, 0.1 if step < 2 else 2.0)
        world.step()
        poses.append((*car.pose, car.speed, car.height))
    return poses


def test_a_reused_car_drives_like_a_new_one():
    """Also where it hardly moved: the contacts of its last run lie where its next one begins."""
    start = Pose(0.3, -0.2, 0.7)
    with World() as fresh:
        wanted = driven(fresh.add_car(), fresh, 12, start)
    with World() as world:
        for steps in (1, 1, 2, 12, 1, 3, 12):
            car = world.add_car()
            assert driven(car, world, steps, start) == wanted[:steps]
            world.give_back(car)
        assert world.cars == []
