import math
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import paddock.simulator.envs
from paddock.errors import UserFault
from paddock.geometry.files import write_npy
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.envs import DEFAULT_METADATA, default_config, load_track
from paddock.simulator.race import Entrant, RaceSettings, run_race
from tests.shared import SHARED, needs_shared
from tests.soak import only

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
STEREO = {**CONTINUOUS, "sensor": ["STEREO_CAMERAS", "LIDAR"]}
SECTORS = {
    **DEFAULT_METADATA,
    "sensor": ["LEFT_CAMERA", "DISCRETIZED_SECTOR_LIDAR"],
    "lidar_config": {"num_sectors": 4, "num_values_per_sector": "3", "clipping_dist": 1.5},
}
KINDS = {"TimeTrial": {}, "ObjectAvoidance": {"random_boxes": 3}, "HeadToHead": {"bots": 3, "bot_lane_changes": True}}


def make_kind(kind, **options):
    return gymnasium.make(f"Paddock/{kind}-v1", **{"track": TRACK, **KINDS[kind], **options})


@pytest.mark.parametrize(
    "metadata",
    [DEFAULT_METADATA, CONTINUOUS, STEREO, SECTORS],
    ids=["discrete", "continuous", "stereo and lidar", "left and sectors"],
)
@pytest.mark.parametrize("start", only(("random",), ("fixed", "random")))
@pytest.mark.parametrize("kind", KINDS)
def test_it_passes_gymnasiums_checker(kind, metadata, start):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make_kind(kind, metadata=metadata, start=start, render_mode="rgb_array").unwrapped)


def test_spaces_come_from_the_metadata():
    spaces = make_kind("TimeTrial", metadata=SECTORS).observation_space.spaces
    assert {name: (space.shape, space.dtype.name) for name, space in spaces.items()} == {
        "DISCRETIZED_SECTOR_LIDAR": ((12,), "float32"),
        "LEFT_CAMERA": ((120, 160, 1), "uint8"),
    }
    stereo = make_kind("TimeTrial", metadata=STEREO)
    assert stereo.observation_space["STEREO_CAMERAS"].shape == (120, 160, 2)
    lidar = stereo.observation_space["LIDAR"]
    assert (lidar.low.min(), lidar.high.max(), lidar.shape) == (np.float32(0.15), 1.0, (64,))


def test_an_episode_equals_a_race_of_the_same_actions():
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
    race = run_race(RaceSettings(TRACK, rules, [Entrant(space, ["FRONT_FACING_CAMERA"], policy)]))
    assert len(asked) == taken
    assert all((a == b).all() for a, b in zip(frames[:-1], asked[1:], strict=True))
    assert info["laps"] == [lap.to_dict() for lap in race.laps]
    assert info["end_reason"] == race.end_reason
    assert statuses.count("off_track") == sum(lap.off_tracks for lap in race.laps)


def test_every_episode_repeats_the_first_bit_for_bit():
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


def test_the_reward_function_gets_the_documented_params():
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
def test_a_non_finite_reward_is_refused(value):
    env = make(reward_function=lambda params: value).unwrapped
    env.reset()
    with pytest.raises(ValueError, match="finite"):
        env.step(0)


def objects_seen(env, seed=None, steps=3):
    """Where the objects are along the track in each of the first steps of an episode."""
    seen = []
    env.unwrapped._drive._setting.reward_function.append_to(seen)
    env.reset(seed=seed)
    for _ in range(steps):
        env.step(4)
    return seen


class Watch:
    """A reward function that keeps what it is given."""

    def __init__(self):
        self._seen = []

    def append_to(self, seen):
        self._seen = seen

    def __call__(self, params):
        self._seen.append([tuple(place) for place in params["objects_location"]])
        return 0.0


@pytest.mark.parametrize("kind", ["ObjectAvoidance", "HeadToHead"])
def test_resets_seed_decides_the_layout(kind):
    env = make_kind(kind, reward_function=Watch())
    first, again = objects_seen(env, 3), objects_seen(env)
    assert len(first[0]) == 3
    assert first[0] != again[0]  # another draw in the next episode
    assert [objects_seen(env, 3), objects_seen(env)] == [first, again]
    assert objects_seen(make_kind(kind, reward_function=Watch()), 3) == first


def test_boxes_stand_still_and_bots_drive():
    boxes = objects_seen(make_kind("ObjectAvoidance", reward_function=Watch()), 1)
    assert boxes[0] == boxes[2]
    bots = objects_seen(make_kind("HeadToHead", reward_function=Watch(), bot_speed_mps=1.5), 1)
    for before, after in zip(bots[0], bots[1], strict=True):
        assert math.dist(before, after) == pytest.approx(1.5 / 15, rel=0.2)


@pytest.mark.parametrize("kind", ["ObjectAvoidance", "HeadToHead"])
def test_a_layout_seed_keeps_the_layout(kind):
    env = make_kind(kind, reward_function=Watch(), layout_seed=5)
    assert objects_seen(env, 1) == objects_seen(env, 2)
    other = make_kind(
        kind, reward_function=Watch(), layout_seed=6, **({"bot_lane_changes": True} if "H" in kind else {})
    )
    assert objects_seen(other, 1) != objects_seen(env, 1)


def test_boxes_may_have_fixed_places():
    places = [(0.25, "inner"), {"fraction": 0.5, "lane": "outer"}]
    env = make_kind("ObjectAvoidance", random_boxes=0, boxes=places, reward_function=Watch())
    wanted = [TRACK.lane_centre(0.25 * TRACK.length, "inner")[:2], TRACK.lane_centre(0.5 * TRACK.length, "outer")[:2]]
    assert np.allclose(objects_seen(env, 9)[0], wanted)


def test_driving_into_a_box_ends_the_episode():
    seen = []
    env = make_kind(
        "ObjectAvoidance",
        random_boxes=0,
        boxes=[(0.12, "inner")],
        reward_function=lambda params: seen.append(params) or 0.0,
    )
    env.reset(options={"start_m": 0.0})
    terminated, steps = False, 0
    while not terminated:  # left of straight on, into the inner lane
        _, _, terminated, _, info = env.step(7 if steps < 3 else 4)
        steps += 1
        assert steps < 40
    assert (info["status"], info["crashes"], info["end_reason"]) == ("crashed", 1, "resets_used")
    assert seen[-1]["is_crashed"] and not any(params["is_crashed"] for params in seen[:-1])
    assert info["laps"][0]["crashes"] == 1


def test_object_avoidance_gives_the_laps_of_a_race():
    """The same actions past the same boxes give the same laps as a race."""
    actions = np.random.default_rng(5).integers(0, 10, 400)
    env = make_kind("ObjectAvoidance", layout_seed=8, max_resets=50, max_simulated_ms=20_000).unwrapped
    env.reset()
    done, taken = False, 0
    while not done:
        _, _, terminated, truncated, info = env.step(int(actions[taken]))
        taken += 1
        done = terminated or truncated
    asked = []

    def policy(readings):
        asked.append(1)
        return np.eye(10, dtype=np.float32)[actions[len(asked) - 1]]

    race = run_race(
        RaceSettings(
            TRACK,
            env.setting.rules,
            [Entrant(ActionSpace.from_metadata(DEFAULT_METADATA), ["FRONT_FACING_CAMERA"], policy)],
        )
    )
    assert len(asked) == taken
    assert info["laps"] == [lap.to_dict() for lap in race.laps]


@pytest.mark.parametrize(
    ("kind", "bad"),
    [
        ("ObjectAvoidance", {"boxes": [(0.2, "left")]}),
        ("ObjectAvoidance", {"random_boxes": 11}),
        ("ObjectAvoidance", {"random_boxes": 3, "boxes": [(0.2, "inner")]}),
        ("HeadToHead", {"bots": 0}),
        ("HeadToHead", {"bots": 7}),
        ("HeadToHead", {"bot_speed_mps": 5.0}),
        ("TimeTrial", {"metadata": {**DEFAULT_METADATA, "sensor": ["FRONT_FACING_CAMERA", "LIDAR", "SECTOR_LIDAR"]}}),
        ("TimeTrial", {"metadata": {**SECTORS, "lidar_config": {"num_sectors": 7}}}),
        ("TimeTrial", {"metadata": {"action_space": [object()]}}),
    ],
)
def test_an_invalid_layout_or_car_is_refused(kind, bad):
    with pytest.raises(ValueError):
        make_kind(kind, **bad)


def test_boxes_without_room_are_refused_with_their_reason():
    with pytest.raises(UserFault) as fault:
        make_kind("ObjectAvoidance", random_boxes=0, boxes=[(0.001, "inner")])
    assert fault.value.code == "box_on_start_line"
    env = make_kind("ObjectAvoidance", random_boxes=10, box_distance_m=5.0)
    with pytest.raises(UserFault) as fault:
        env.reset(seed=0)
    assert fault.value.code == "boxes_do_not_fit"


def test_an_unknown_argument_is_named():
    with pytest.raises(TypeError, match="bots"):
        paddock.simulator.envs.TimeTrialEnv(track=TRACK, bots=3)


@pytest.mark.parametrize("start", [float("nan"), float("inf")])
def test_an_invalid_start_is_refused(start):
    with pytest.raises(ValueError, match="start_m"):
        make().reset(options={"start_m": start})


@pytest.mark.parametrize(
    "bad", [{"start": "middle"}, {"direction": "up"}, {"render_mode": "human"}, {"laps": 0}, {"metadata": LIDAR}]
)
def test_wrong_arguments_are_refused(bad):
    with pytest.raises(ValueError):
        paddock.simulator.envs.TimeTrialEnv(track=TRACK, **bad)


def test_a_track_may_be_a_geometry_a_slug_or_a_file(tmp_path):
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


@pytest.mark.parametrize("name, race_type", [("TimeTrial", "time_trial"), ("HeadToHead", "head_to_head")])
def test_the_default_configuration_is_what_an_environment_has_without_one(name, race_type):
    plain, given = (
        gymnasium.make(f"Paddock/{name}-v1", **options) for options in ({}, {"config": default_config(race_type)})
    )
    one, other = plain.unwrapped.setting, given.unwrapped.setting
    assert one.rules == other.rules and one.metadata == other.metadata and one.reward_function is other.reward_function
    assert one.ground.track.fingerprint == other.ground.track.fingerprint


def test_a_configuration_changes_what_it_names_and_arguments_override_it():
    config = {"laps": 3, "max_resets": 20, "start": "random"}
    setting = gymnasium.make("Paddock/TimeTrial-v1", config=config, laps=2).unwrapped.setting
    assert (setting.rules.laps, setting.rules.max_resets, setting.random_start) == (2, 20, True)
    with pytest.raises(TypeError, match="boxes"):
        gymnasium.make("Paddock/TimeTrial-v1", config={"boxes": [(0.5, "inner")]})


def test_a_whole_configuration_follows_the_track_and_the_boxes():
    config = default_config("object_avoidance") | {"track": "penbay_open_cw", "boxes": [(0.5, "inner")]}
    rules = gymnasium.make("Paddock/ObjectAvoidance-v1", config=config).unwrapped.setting.rules
    assert (rules.direction, len(rules.boxes), rules.random_boxes) == ("cw", 1, 0)


def test_many_cars_take_a_configuration_too():
    env = gymnasium.make_vec("Paddock/TimeTrial-v1", num_envs=2, config={"laps": 4, "reward_function": [len, abs]})
    assert env.unwrapped.setting.rules.laps == 4
    assert [one.reward_function for one in env.unwrapped._settings] == [len, abs]
    env.close()
