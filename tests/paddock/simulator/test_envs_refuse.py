"""What environments refuse with a next step: copies, pickles, unknown options, starts off the lap; and processes."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import paddock.simulator.envs  # noqa: F401  registers the environments
from paddock.simulator.vector import TimeTrialVectorEnv
from tests.shared import CHECKOUT

OVAL_M = 18.0


@pytest.fixture(params=["single", "vector"])
def env(request):
    made = gymnasium.make("Paddock/TimeTrial-v1") if request.param == "single" else TimeTrialVectorEnv(num_envs=2)
    yield made
    made.close()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: copy.copy(env.unwrapped), pickle.dumps])
def test_an_environment_is_neither_copied_nor_pickled(env, copied):
    seen, _ = env.reset(seed=3)
    with pytest.raises(TypeError, match=r"gymnasium\.make\(env\.spec\)"):
        copied(env)
    again, _ = env.reset(seed=3)  # and the original drives on
    assert all(np.array_equal(seen[name], again[name]) for name in seen)
    env.step(env.action_space.sample())


def test_an_environment_is_made_again_by_its_spec():
    env = gymnasium.make("Paddock/TimeTrial-v1", track="reinvent_base")
    twin = gymnasium.make(env.spec)
    first, second = env.reset(seed=5)[0], twin.reset(seed=5)[0]
    assert all(np.array_equal(first[name], second[name]) for name in first)
    env.close()
    assert twin.step(twin.action_space.sample())
    twin.close()


def test_unknown_options_are_refused(env):
    with pytest.raises(ValueError, match=r"no option begin_m.*start_m"):
        env.reset(options={"begin_m": 3.0})
    env.reset(options={})
    env.reset(options=None)


@pytest.mark.parametrize("start", [-0.1, OVAL_M, 999.0, float("nan")])
def test_a_start_off_the_lap_is_refused(env, start):
    with pytest.raises(ValueError, match="start_m"):
        env.reset(options={"start_m": start})
    env.reset(options={"start_m": 17.9})


@pytest.mark.parametrize("start", [-1.0, OVAL_M, 500.0])
def test_an_environment_with_a_start_off_the_lap_is_refused(start):
    with pytest.raises(ValueError, match="start_m"):
        gymnasium.make("Paddock/TimeTrial-v1", start_m=start)


SPAWN = """
def main():
    import gymnasium
    import paddock.simulator.envs
    made = [lambda: gymnasium.make("Paddock/TimeTrial-v1", track="penbay_open")] * 2
    env = gymnasium.vector.AsyncVectorEnv(made, context={context!r})
    seen, _ = env.reset(seed=1)
    env.step(env.action_space.sample())
    print("seen", next(iter(seen.values())).shape)
    env.close()

if __name__ == "__main__":
    main()
"""


@pytest.mark.slow
@pytest.mark.parametrize("context", ["spawn", "forkserver"])
def test_processes_that_are_spawned_know_the_environments(tmp_path, context):
    script = tmp_path / "train.py"
    script.write_text(SPAWN.replace("{context!r}", repr(context)))
    ran = subprocess.run(
        [sys.executable, str(script)],
        cwd=CHECKOUT,
        env={"PYTHONPATH": str(CHECKOUT), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=180,
    )
    assert "seen (2, 120, 160, 1)" in ran.stdout, ran.stderr
