"""Many environments in many processes, by Gymnasium and by stable-baselines3, begun by whatever method."""

from __future__ import annotations

import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import paddock.deepracer
from tests.shared import CHECKOUT

assert paddock.deepracer

# As a student's program does it: the environment is made in the child, which has not imported paddock.deepracer.
PROGRAM = """
import multiprocessing, sys
import gymnasium as gym
import paddock.deepracer

count, method, kind = int(sys.argv[1]), sys.argv[2], sys.argv[3]

def make(number):
    return lambda: gym.make("deepracer-v0", port=8888 + number)

if __name__ == "__main__":
    makers = [make(number) for number in range(count)]
    if kind == "sb3":
        from stable_baselines3.common.vec_env import SubprocVecEnv
        cars = SubprocVecEnv(makers, start_method=method)
        cars.seed(1)
        seen = cars.reset()
        for _ in range(20):
            seen, rewards, dones, infos = cars.step([cars.action_space.sample() for _ in range(count)])
        assert len(infos) == count and all("reward_params" in info for info in infos)
    else:
        cars = gym.vector.AsyncVectorEnv(makers, context=method)
        seen, _ = cars.reset(seed=1)
        for _ in range(20):
            seen, rewards, ends, cuts, infos = cars.step(cars.action_space.sample())
        assert len(infos["reward_params"]["progress"]) == count
    print(seen["STEREO_CAMERAS"].shape, seen["LIDAR"].shape, len({frame.tobytes() for frame in seen["STEREO_CAMERAS"]}))
    cars.close()
"""


def run(tmp_path, count: int, method: str, kind: str) -> None:
    path = tmp_path / "program.py"
    path.write_text(PROGRAM)
    command = [sys.executable, str(path), str(count), method, kind]
    done = subprocess.run(command, capture_output=True, text=True, env={"PYTHONPATH": str(CHECKOUT), **THREADS})
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.splitlines()[-1] == f"({count}, 2, 120, 160) ({count}, 64) {count}"


THREADS = {"OMP_NUM_THREADS": "1"}


@pytest.mark.parametrize("method", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_gymnasiums_processes(method, tmp_path):
    run(tmp_path, 2, method, "gymnasium")


@pytest.mark.slow
def test_the_processes_of_stable_baselines3(tmp_path):
    pytest.importorskip("stable_baselines3", reason="training is not installed: make training")
    run(tmp_path, 2, "forkserver", "sb3")


@pytest.mark.soak
@pytest.mark.parametrize("method", ["forkserver", "spawn"])
def test_32_processes_of_stable_baselines3(method, tmp_path):
    pytest.importorskip("stable_baselines3", reason="training is not installed: make training")
    run(tmp_path, 32, method, "sb3")


def test_many_in_one_process_are_those_of_single_environments():
    cars = gymnasium.make_vec("deepracer-v0", num_envs=2, vectorization_mode="sync")
    seen, infos = cars.reset(seed=4)
    single = gymnasium.make("deepracer-v0")
    one, info = single.reset(seed=5)
    for name in one:
        np.testing.assert_array_equal(seen[name][1], one[name])
    assert infos["reward_params"]["x"][1] == info["reward_params"]["x"]
    seen, rewards, *_ = cars.step(np.array([2, 2]))
    assert rewards[1] == single.step(2)[1]
