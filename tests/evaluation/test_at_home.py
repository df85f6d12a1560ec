"""What a racer drives in an environment at home, in a process that was started for it, is what the site drives."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import paddock.simulator.envs  # noqa: F401  registers the environments
import training.house_cars
from evaluation.running.pipeline import RaceJob, evaluate
from paddock.exact import PINS, environment, is_pinned
from paddock.geometry.catalogue import CATALOGUE
from paddock.network.session import load
from paddock.rules.race import RaceRules
from paddock.simulator.action import DISCRETE, ActionSpace
from paddock.simulator.deciding import Policy
from paddock.simulator.sensors import policy_header
from tests.pinned import pinned_process

pytestmark = pytest.mark.slow
LAPS_MS = 12_000
CARS = Path(training.house_cars.__file__).parent


def drive_at_home(onnx: bytes, metadata: dict) -> tuple[bool, dict[str, np.ndarray]]:
    """Whether the environment calls itself exact, and the trace of what the car drove in it."""
    env = gymnasium.make("Paddock/TimeTrial-v1", metadata=metadata, max_resets=5, max_simulated_ms=LAPS_MS)
    space = ActionSpace.from_metadata(metadata)
    policy = Policy(load(onnx), policy_header(metadata, space))
    seen, _ = env.reset(seed=1)
    over = False
    while not over:
        answer = policy.answer(seen)
        seen, _, terminated, truncated, _ = env.step(int(np.argmax(answer)) if space.kind == DISCRETE else answer)
        over = terminated or truncated
    return env.unwrapped.exact, env.unwrapped._drive.car.trace().columns


@pytest.fixture(scope="module")
def pinned():
    with pinned_process() as process:
        yield process


@pytest.mark.parametrize("name", ["flyer", "brisk"])
def test_a_car_drives_the_same_at_home_as_on_the_site(name, pinned):
    onnx, metadata = ((CARS / f"{name}.{kind}").read_bytes() for kind in ("onnx", "json"))
    metadata = json.loads(metadata)
    exact, at_home = pinned.submit(drive_at_home, onnx, metadata).result()
    track = next(entry for entry in CATALOGUE if entry.slug == "oval").geometry()
    rules = RaceRules(laps=1, max_resets=5, max_simulated_ms=LAPS_MS)
    on_the_site = evaluate(RaceJob(track, rules, onnx, metadata))
    rows = on_the_site.trace_csv.decode().splitlines()
    assert exact
    assert len(rows) - 1 == len(at_home["X"]) > 50
    for name in ("X", "Y", "yaw", "steer", "throttle", "tstamp"):
        place = rows[0].split(",").index(name)
        assert [float(row.split(",")[place]) for row in rows[1:]] == at_home[name].tolist()


def test_a_program_starts_pinned_with_its_own_arguments():
    program = "import sys; from paddock.exact import is_pinned; print(is_pinned(), sys.argv[1:])"
    command = [sys.executable, "-m", "paddock.exact", "-c", program, "--laps", "3"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[-2] == "True ['--laps', '3']"


def test_other_glibc_tunables_are_kept():
    made = environment({"GLIBC_TUNABLES": "glibc.malloc.hugetlb=1:glibc.cpu.hwcaps=-SSE4_2", "HOME": "/"})
    assert made["GLIBC_TUNABLES"] == f"glibc.malloc.hugetlb=1:{PINS['GLIBC_TUNABLES']}"
    assert made["HOME"] == "/" and is_pinned(made)
    assert not is_pinned({**made, "OPENCV_CPU_DISABLE": ""})
