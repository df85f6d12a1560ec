"""``deepracer-v0`` has the arguments, spaces, infos and ends of the original."""

from __future__ import annotations

import copy
import inspect
import json
import logging
import subprocess
import sys

import cv2
import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from PIL import Image

import paddock.deepracer
from paddock.deepracer.env import DeepRacerEnv
from paddock.simulator.camera.colours import colours
from paddock.simulator.rewards import follow_centre_line
from tests.shared import CHECKOUT

CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"high": 30, "low": -30}, "speed": {"high": 2, "low": 1}},
}
FRONT = {"sensor": ["FRONT_FACING_CAMERA"]}
STILL = {"CHANGE_START_POSITION": "false", "ALTERNATE_DRIVING_DIRECTION": "false"}
PARAMS = """
all_wheels_on_track x y heading distance_from_center progress steps speed steering_angle track_width track_length
waypoints closest_waypoints is_left_of_center is_reversed closest_objects objects_location objects_left_of_center
objects_speed objects_heading objects_distance is_crashed is_offtrack
""".split()  # noqa: SIM905


def make(**arguments) -> gymnasium.Env:
    return gymnasium.make("deepracer-v0", **arguments)


def drive(env: gymnasium.Env, choose, steps: int = 3000) -> list[tuple]:
    """The steps of an episode."""
    taken = []
    while len(taken) < steps and not (taken and (taken[-1][2] or taken[-1][3])):
        taken.append(env.step(choose(taken)))
    return taken


def ended(status: dict) -> list[str]:
    return [name for name, is_so in status.items() if is_so]


def test_the_arguments_are_those_of_the_original():
    names = inspect.signature(DeepRacerEnv).parameters
    assert {name: one.default for name, one in names.items()} == {
        "agent_config": None,
        "track_config": None,
        "reward_function": None,
        "world_name": None,
        "evaluation": False,
        "render_mode": "rgb_array",
        "image": None,
        "cpus": 3.0,
        "memory": "6g",
        "cache": False,
        "manage_container": True,
        "host": "127.0.0.1",
        "port": None,
    }


def test_the_default_has_a_pair_of_cameras_a_lidar_and_five_actions():
    env = make()
    boxes = env.observation_space.spaces
    assert set(boxes) == {"STEREO_CAMERAS", "LIDAR"}
    assert boxes["STEREO_CAMERAS"] == gymnasium.spaces.Box(0, 255, (2, 120, 160), np.uint8)
    assert boxes["LIDAR"] == gymnasium.spaces.Box(0.15, float("inf"), (64,), np.float32)
    assert env.action_space == gymnasium.spaces.Discrete(5)
    actions = env.unwrapped.setting.actions.actions
    assert actions == ((30.0, 0.6), (15.0, 0.6), (0.0, 0.6), (-15.0, 0.6), (-30.0, 0.6))
    assert env.unwrapped.reward_function is follow_centre_line


def test_steering_comes_before_speed_and_both_are_scaled():
    env = make(agent_config=CONTINUOUS | {"sensor": ["FRONT_FACING_CAMERA", "LIDAR"]}, track_config=STILL)
    assert env.action_space == gymnasium.spaces.Box(-1, 1, (2,), np.float64)
    env.reset(seed=1)
    *_, info = env.step(np.array([0.5, -1.0]))
    assert (info["reward_params"]["steering_angle"], info["reward_params"]["speed"]) == (15.0, 1.0)


@pytest.mark.parametrize(
    "agent",
    [None, FRONT, CONTINUOUS, CONTINUOUS | {"sensor": ["FRONT_FACING_CAMERA", "LIDAR"]}],
    ids=["default", "colour", "continuous", "colour and lidar"],
)
def test_it_passes_gymnasiums_checker(agent):
    env = make(agent_config=agent)
    check_env(env.unwrapped)
    observation, info = env.reset(seed=2)
    for _ in range(5):
        assert env.observation_space.contains(observation)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert (type(reward), type(terminated), type(truncated)) == (float, bool, bool)
    assert set(PARAMS) <= set(info["reward_params"])


def test_the_reward_is_that_of_the_params_in_the_info():
    seen = []

    def reward_function(params):
        seen.append(params)
        return 7 * params["steps"]

    env = make(reward_function=reward_function)
    _, info = env.reset(seed=3)
    assert info["reward_params"]["steps"] == 1 and not seen
    for _ in range(3):
        _, reward, *_, info = env.step(2)
        assert info["reward_params"] is seen[-1] and reward == 7.0 * info["reward_params"]["steps"]


def test_the_front_camera_is_in_colour_and_its_luma_is_what_a_race_shows():
    env = make(agent_config=FRONT, track_config=STILL)
    picture = env.reset(seed=1)[0]["FRONT_FACING_CAMERA"]
    race = gymnasium.make("Paddock/TimeTrial-v1", track="reInvent2019_wide").reset(seed=1)[0]["FRONT_FACING_CAMERA"]
    assert picture.shape == (3, 120, 160) and len(np.unique(picture.reshape(3, -1), axis=1).T) > 20
    assert np.ptp(picture.astype(int), axis=0).max() > 50, "it is grey"
    rgb = np.ascontiguousarray(picture.transpose(1, 2, 0))
    np.testing.assert_array_equal(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), race[:, :, 0])
    np.testing.assert_array_equal(np.asarray(Image.fromarray(rgb).convert("L")), race[:, :, 0])
    np.testing.assert_array_equal(env.render(), rgb)
    assert not colours()[0].any(), "stacked frames begin with zeros, in grey and in colour"


def test_the_pair_is_drawn_side_by_side():
    env = make()
    assert env.unwrapped.render() is None
    left, right = env.reset(seed=1)[0]["STEREO_CAMERAS"]
    shown = env.render()
    assert shown.shape == (120, 320, 3) and shown.dtype == np.uint8
    np.testing.assert_array_equal(shown[:, :160, 1], left)
    np.testing.assert_array_equal(shown[:, 160:, 2], right)


def test_a_car_that_leaves_the_road_is_terminated():
    env = make(agent_config={"action_space": [{"steering_angle": 30, "speed": 3}]}, track_config=STILL)
    env.reset(seed=1)
    *before, last = drive(env, lambda _: 0)
    assert not any(step[2] or step[3] or ended(step[4]["episode_status"]) for step in before) and len(before) > 5
    assert last[2:4] == (True, False) and ended(last[4]["episode_status"]) == ["off_track"]
    assert last[4]["reward_params"]["is_offtrack"] and env.step(0) == last, "the last step is returned again"
    assert env.reset()[1]["reward_params"]["steps"] == 1


def follow(taken: list[tuple]) -> list[float]:
    """Steers to the centre line, at full speed."""
    if not taken:
        return [0.0, 1.0]
    params = taken[-1][4]["reward_params"]
    points, (_, ahead) = params["waypoints"], params["closest_waypoints"]
    x, y = points[(ahead + 2) % len(points)]
    turn = np.degrees(np.arctan2(y - params["y"], x - params["x"])) - params["heading"]
    return [float(np.clip(((turn + 180) % 360 - 180) / 30, -1, 1)), 1.0]


def test_a_car_that_hits_a_box_is_terminated():
    track = STILL | {"OBJECT_POSITIONS": ["0.5,1"], "WORLD_NAME": "Oval_track"}
    env = make(agent_config=CONTINUOUS, track_config=track)
    env.reset(seed=1)
    last = drive(env, follow)[-1]
    assert last[2:4] == (True, False) and ended(last[4]["episode_status"]) == ["crashed"]
    assert last[4]["reward_params"]["is_crashed"] and 40 < last[4]["reward_params"]["progress"] < 50


def test_a_whole_lap_is_terminated_at_a_hundred_percent():
    env = make(agent_config=CONTINUOUS, track_config=STILL, world_name="Oval_track")
    env.reset(seed=1)
    last = drive(env, follow)[-1]
    assert last[2:4] == (True, False) and ended(last[4]["episode_status"]) == ["lap_complete"]
    assert last[4]["reward_params"]["progress"] == 100.0


@pytest.mark.parametrize(("name", "flags"), [("immobilized", (False, True)), ("time_up", (False, True)),
                                              ("reversed", (True, False)), ("crashed", (True, False))])  # fmt: skip
def test_how_each_end_is_told(name, flags, monkeypatch):
    env = make(track_config=STILL)
    env.reset(seed=1)
    judge = env.unwrapped._drive.judge

    def judged():
        outcome = judge()
        info = {**outcome.info, "status": name}
        return outcome._replace(terminated=name != "time_up", truncated=name == "time_up", info=info)

    monkeypatch.setattr(env.unwrapped._drive, "judge", judged)
    *_, terminated, truncated, info = env.step(2)
    assert (terminated, truncated) == flags and ended(info["episode_status"]) == [name]


def test_the_time_is_up_after_180_seconds():
    slow = CONTINUOUS | {"action_space": CONTINUOUS["action_space"] | {"speed": {"low": 0.1, "high": 0.2}}}
    env = make(agent_config=slow, track_config=STILL, world_name="Spain_track")
    env.reset(seed=1)
    taken = drive(env, follow)
    assert len(taken) == 180 * 15 and taken[-1][2:4] == (False, True)
    assert ended(taken[-1][4]["episode_status"]) == ["time_up"]


def episode(env: gymnasium.Env, seed: int) -> list:
    observation, info = env.reset(seed=seed)
    found = [observation, info]
    for action in (2, 1, 2, 3, 2, 2):
        found += env.step(action)
    return found


@pytest.mark.parametrize("track", [{}, {"NUMBER_OF_OBSTACLES": "4"}, {"NUMBER_OF_BOT_CARS": "3"},
                                   {"ENABLE_DOMAIN_RANDOMIZATION": "true"}])  # fmt: skip
def test_the_same_seed_gives_the_same_episode(track):
    env = make(track_config=track)
    first = episode(env, 5)
    again, other = episode(env, 5), episode(make(track_config=track), 5)
    for one in (again, other):
        for mine, its in zip(first, one, strict=True):
            np.testing.assert_equal(mine, its)
    assert episode(env, 6)[1]["reward_params"]["x"] != first[1]["reward_params"]["x"]


def test_directions_alternate_from_episode_to_episode():
    env = make()
    env.reset(seed=1)
    ways = [env.reset()[1]["reward_params"]["is_reversed"] for _ in range(4)]
    assert ways == [True, False, True, False]


def test_what_concerns_containers_is_ignored_with_one_line(caplog):
    with caplog.at_level(logging.DEBUG, "paddock.deepracer"):
        env = make(image="x/y:1", cpus=1, memory="1g", cache=True, manage_container=False, host="h", port=8888)
    (line,) = [record.getMessage() for record in caplog.records if record.name == "paddock.deepracer"]
    assert all(word in line for word in ("x/y:1", "cpus=1", "1g", "cache=True", "host='h'", "port=8888"))
    env.reset(seed=1)


def test_what_is_open_is_listed_until_it_is_closed():
    paddock.deepracer.shutdown_all()
    one, other = make(), make(world_name="Oval_track")
    names = paddock.deepracer.running()
    assert len(names) == 2 and names[1].endswith("Oval_track")
    paddock.deepracer.close(one, cache=False)
    assert paddock.deepracer.running() == names[1:]
    other.unwrapped.close(cache=True)
    other.close()
    assert paddock.deepracer.running() == []


def test_it_cannot_be_copied_and_says_what_to_do():
    with pytest.raises(TypeError, match=r"gymnasium\.make"):
        copy.deepcopy(make().unwrapped)


def test_the_agent_may_be_a_file_of_json(tmp_path):
    path = tmp_path / "agent_params.json"
    path.write_text(json.dumps(CONTINUOUS | FRONT))
    for given in (path, str(path)):
        env = make(agent_config=given)
        assert env.action_space.shape == (2,) and list(env.observation_space) == FRONT["sensor"]


REFUSED = [
    ({"sensor": ["SECTOR_LIDAR"]}, "sensor.*SECTOR_LIDAR"),
    ({"sensor": ["LEFT_CAMERA"]}, "sensor.*LEFT_CAMERA"),
    ({"sensor": ["LIDAR"]}, "needs one camera"),
    ({"sensor": ["FRONT_FACING_CAMERA", "STEREO_CAMERAS"]}, "needs one camera"),
    ({"sensor": "LIDAR"}, "sensor"),
    ({"action_space": []}, "agent_config: The action space has no actions"),
    ({"action_space": [{"speed": 1}]}, "steering_angle"),
    ({"action_space_type": "none"}, "action_space_type"),
    (CONTINUOUS | {"action_space": {"speed": {"low": 1, "high": 2}}}, "steering_angle"),
]


@pytest.mark.parametrize(("agent", "said"), REFUSED)
def test_an_impossible_agent_is_refused_by_its_key(agent, said):
    with pytest.raises(ValueError, match=said):
        make(agent_config=agent)


@pytest.mark.parametrize("arguments", [{"agent_config": [1]}, {"track_config": "x"}, {"colour": 1}])
def test_another_type_and_another_argument_are_refused(arguments):
    with pytest.raises(TypeError, match=next(iter(arguments))):
        make(**arguments)


@pytest.mark.parametrize("action", [5, -1, 0.5, [1, 2], None])
def test_an_impossible_action_is_refused_and_the_car_has_not_moved(action):
    env = make(track_config=STILL)
    env.reset(seed=1)
    before = env.unwrapped._drive.car.car.pose
    with pytest.raises(ValueError, match="whole number from 0 to 4"):
        env.step(action)
    assert env.unwrapped._drive.car.car.pose == before


def test_where_no_physics_is_installed_it_says_what_to_do():
    program = "import sys; sys.modules['pybullet'] = None\nimport paddock.deepracer"
    hidden = "import importlib.util as u; f = u.find_spec\nu.find_spec = lambda n: None if n == 'pybullet' else f(n)\n"
    done = subprocess.run([sys.executable, "-c", hidden + program], capture_output=True, text=True, cwd=CHECKOUT)
    said = done.stderr.split("ImportError: ")[-1]
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    assert all(word in said for word in ("PyBullet", f"Python {version}", "--find-links", "Python 3.11", "WSL"))


def test_neither_torch_nor_stable_baselines3_is_imported_by_it():
    program = (
        "import sys, gymnasium, paddock.deepracer, paddock.deepracer.old_gym\n"
        "gymnasium.make('deepracer-v0').reset(seed=1)\n"
        "print([name for name in ('torch', 'stable_baselines3', 'django') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=CHECKOUT, check=True)
    assert done.stdout.strip().endswith("[]")
