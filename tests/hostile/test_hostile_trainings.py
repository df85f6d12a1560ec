"""The same hostile functions in a training: in the trainer's process they meet the simulator, and still hurt nobody.

They are handed to the trainer as they are, past the check of the text, which is help and no wall.
"""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import pytest

from evaluation.pipeline import RaceJob, evaluate
from evaluation.sandbox.probe import probe
from evaluation.simulator import referee, rules
from faults import UserFault
from tracks.catalogue import CATALOGUE
from training.hyperparameters import DEFAULT_ACTIONS, check_hyperparameters
from training.trainer import client
from training.trainer.client import Iteration, Listener, train
from training.trainer.spec import TrainerSpec

from .test_hostile import children, descriptors
from .test_hostile_rewards import marked_lines, source

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = pytest.mark.slow

OVAL = next(track for track in CATALOGUE if track.slug == "oval").geometry()
METADATA = {
    "action_space": [dict(action) for action in DEFAULT_ACTIONS],
    "action_space_type": "discrete",
    "sensor": ["FRONT_FACING_CAMERA"],
    "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "training_algorithm": "clipped_ppo",
    "version": "5",
}
CASES = (
    "reward_too_slow/endless_loop",
    "reward_too_slow/endless_at_the_top",
    "reward_memory/grows_a_list",
    "reward_not_finite/nan",
    "reward_too_large/a_million",
    "reward_not_a_number/nothing",
    "reward_raised/divides_by_zero",
    "reward_raised/says_goodbye",
    "reward_raised/opens_a_file_by_the_back_door",
    "reward_raised/writes_a_file_by_the_back_door",
    "reward_raised/opens_a_socket_by_the_back_door",
    "reward_raised/forks",
    "reward_raised/starts_a_program",
    "reward_raised/kills_everybody",
    "reward_prints_too_much/a_gigabyte_in_lines",
    "reward_stuck/ends_the_process",
    "reward_stuck/aborts",
    "reward_stuck/reads_where_nothing_is",
    "reward_stuck/waits_for_ever",
    "reward_too_slow/endless_inside_of_python",
)
# The same function in other words: what the trainer's process can tell of it.
OTHERWISE = {"reward_too_slow/endless_inside_of_python": "reward_stuck"}
SAYS_IT_LAPS = """
import random


def reward_function(params):
    modules = random._os.sys.modules
    modules["evaluation.simulator.referee"].Referee.percent = property(lambda self: 100.0)
    modules["evaluation.simulator.car"].Car.command = lambda self, steering, speed: None
    return 1.0
"""


class Heard(Listener):
    """Keeps what the training tells."""

    def __init__(self) -> None:
        self.iterations: list[Iteration] = []

    def iteration(self, iteration: Iteration) -> None:
        self.iterations.append(iteration)


def spec(code: str, **changes: Any) -> TrainerSpec:
    return TrainerSpec(
        track=OVAL.to_dict(),
        race_type="time_trial",
        metadata=METADATA,
        algorithm="ppo",
        hyperparameters=check_hyperparameters("ppo", {}),
        reward_code=code,
        **{"stop_seconds": 60.0, "stop_steps": 4000, "trials": 1, **changes},
    )


@pytest.fixture(autouse=True)
def _wall():
    if probe().level < 2:
        pytest.skip("this host offers no wall")


@pytest.mark.parametrize("case", CASES)
def test_a_training_ends_with_the_code_and_the_line(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(client, "_SILENCE_S", 15.0)
    text = source(case)
    before = descriptors(), children()
    with pytest.raises(UserFault) as fault:
        train(spec(text), Heard())
    assert fault.value.code == OTHERWISE.get(case, case.split("/")[0]), fault.value.__notes__
    assert fault.value.params.get("line") in marked_lines(text)
    assert (descriptors(), children()) == before, "something was left open or running"
    assert list(tmp_path.iterdir()) == [], "something was written"


def test_a_function_that_patches_the_simulator_spoils_its_own_training_only() -> None:
    """It makes the trainer say that every step is a whole lap. The evaluation that counts happens elsewhere."""
    heard = Heard()
    train(spec(SAYS_IT_LAPS, stop_steps=3000), heard)
    assert heard.iterations
    assert max(iteration.values["eval_progress"] for iteration in heard.iterations) == 100.0
    race = rules.RaceRules(laps=1, max_resets=0, max_simulated_ms=20_000)
    job = RaceJob(OVAL, race, heard.iterations[-1].onnx, METADATA)
    outcome = evaluate(job)
    assert outcome.metrics["metrics"][0]["completion_percentage"] < 100
    assert evaluate(job).trace_sha256 == outcome.trace_sha256
    assert "percent" in inspect.getsource(referee.Referee.percent.fget), "it reached this process"


def test_a_training_next_to_it_learns_the_same_as_alone() -> None:
    """Two processes share nothing: the honest one's numbers do not move."""
    honest = "def reward_function(params):\n    return float(params['all_wheels_on_track'])\n"
    alone, beside = Heard(), Heard()
    train(spec(honest, stop_steps=2500), alone)
    with pytest.raises(UserFault):
        train(spec(source("reward_raised/kills_everybody")), Heard())
    train(spec(honest, stop_steps=2500), beside)
    first, second = ([one.values["mean_reward"] for one in heard.iterations] for heard in (alone, beside))
    assert first == second
    assert first
