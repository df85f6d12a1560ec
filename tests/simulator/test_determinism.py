"""One car, one result: the same hash on every run, in every process, whatever else the machine does."""

import multiprocessing
import subprocess
import sys

import numpy as np
import pytest

from evaluation.simulator.action import ActionSpace
from evaluation.simulator.race import run_race
from evaluation.simulator.rules import RaceRules
from tests.shared import CHECKOUT

from .tracks_for_tests import stadium

SPACE = ActionSpace.discrete([(-20, 1.0), (-10, 2.0), (0, 3.0), (10, 2.0), (20, 1.0), (30, 1.5)])


class Camera:
    """Drives by what the picture shows, so that any difference in a frame or a state comes back in the path."""

    def __init__(self) -> None:
        self.weights = np.random.default_rng(11).normal(size=(SPACE.size, 30 * 40))

    def __call__(self, readings):
        frame = readings["FRONT_FACING_CAMERA"].reshape(30, 4, 40, 4).astype(np.int64).sum(axis=(1, 3))
        return (self.weights @ (frame - frame.mean()).ravel()).astype(np.float32)


def race():
    rules = RaceRules(max_simulated_ms=40_000)
    result = run_race(stadium(), rules, SPACE, ["FRONT_FACING_CAMERA"], Camera())
    return result.trace.sha256, result


@pytest.fixture(scope="module")
def expected():
    return race()


def test_the_race_is_worth_comparing(expected):
    _, result = expected
    trace = result.trace
    assert len(set(trace["action"].tolist())) >= 3
    assert sum(lap.resets for lap in result.laps) >= 2
    assert result.steps == 600


def test_five_runs_in_one_process_give_one_hash(expected):
    assert {race()[0] for _ in range(5)} == {expected[0]}


def test_a_fresh_process_gives_the_same_hash(expected):
    code = "from tests.simulator.test_determinism import race; print(race()[0])"
    for seed in ("0", "1"):
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=CHECKOUT,
            env={"PYTHONHASHSEED": seed, "PATH": "/usr/bin:/bin"},
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        )
        assert done.stdout.split()[-1] == expected[0]


def _spin(stop):
    while not stop.is_set():
        sum(range(10_000))


def test_busy_neighbours_change_nothing(expected):
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    neighbours = [context.Process(target=_spin, args=(stop,), daemon=True) for _ in range(2)]
    for neighbour in neighbours:
        neighbour.start()
    try:
        assert race()[0] == expected[0]
    finally:
        stop.set()
        for neighbour in neighbours:
            neighbour.join()


def test_a_run_before_it_changes_nothing(expected):
    run_race(stadium(radius=0.9), RaceRules(max_simulated_ms=3000), SPACE, ["FRONT_FACING_CAMERA"], Camera())
    assert race()[0] == expected[0]
