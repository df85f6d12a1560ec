"""The same hostile functions in a training: in the trainer's process they meet the simulator, and still hurt nobody.

They are handed to the trainer as they are, past the check of the text, which is help and no wall.
"""

from __future__ import annotations

import inspect
import time
from pathlib import Path
from typing import Any

import pytest

from evaluation.running.pipeline import RaceJob, evaluate
from evaluation.sandbox.probe import probe
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.simulator import referee
from tests.soak import one_of_each
from training.jobs.settings_checks import DEFAULT_ACTIONS, check_hyperparameters
from training.trainer import client
from training.trainer.client import Iteration, Listener, train
from training.trainer.spec import TrainerSpec

from .test_hostile import children, descriptors, is_left
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
    "reward_too_slow/endless_loop_that_catches_everything",
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
    "reward_stuck/exits_as_if_killed",
    "reward_stuck/exits_with_200",
    "reward_stuck/exits_as_if_not_locked",
    "reward_stuck/aborts",
    "reward_stuck/reads_where_nothing_is",
    "reward_stuck/waits_for_ever",
    "reward_too_slow/endless_inside_of_python",
    "reward_too_slow/endless_when_an_object_ends",
)
# The same function in other words: what the trainer's process can tell of it.
OTHERWISE = {"reward_too_slow/endless_inside_of_python": "reward_stuck"}
SILENT = ("reward_stuck/waits_for_ever", *OTHERWISE)  # nothing else ends these
SAYS_IT_LAPS = """
import random


def reward_function(params):
    modules = getattr(random, "_os").sys.modules
    modules["paddock.simulator.referee"].Referee.percent = property(lambda self: 100.0)
    modules["paddock.simulator.car"].Car.command = lambda self, steering, speed: None
    return 1.0
"""


# What none of the checks beforehand sees: it happens only where a training is, and there it reaches for the trainer.
REACH = """
import random

modules = getattr(random, "_os").sys.modules
trainer = modules.get("training.trainer.process")


def found(name):
    return next(one for one in modules["gc"].get_objects() if type(one).__name__ == name)


"""
IN_TRAINING_ONLY = {
    "exits with a status of ours": (
        "reward_stuck",
        "def reward_function(params):\n    if trainer:\n        getattr(random, '_os')._exit(73)\n    return 1.0\n",
    ),
    "crashes and says nothing": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        modules["faulthandler"].disable()
        modules["ctypes"].string_at(0)
    return 1.0
""",
    ),
    "closes the pipes": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        getattr(random, "_os").closerange(0, 64)
        while True:
            modules["time"].sleep(1)
    return 1.0
""",
    ),
    "writes half a frame": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        getattr(random, "_os").write(found("Training")._out, (500).to_bytes(4, "little") + b"{")
        while True:
            modules["time"].sleep(1)
    return 1.0
""",
    ),
    "forges an iteration": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        iteration = {"number": 1, "steps": 2**31 - 1, "eval_lap_ms": 1, "is_best": True}
        modules["evaluation.sandbox.frames"].write_message(
            found("Training")._out, {"iteration": iteration, "driving": []}, [b"a network", b"a trace"]
        )
    return 1.0
""",
    ),
    "forges an end": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        end = {"done": "clean_laps", "steps": 1, "seconds": 0.1}
        modules["evaluation.sandbox.frames"].write_message(found("Training")._out, end, [b"PK"])
    return 1.0
""",
    ),
    "leaves more than its network weighs": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        modules["training.trainer.learners"].Learner.to_zip = lambda self: bytes(100_000_000)
    return 1.0
""",
    ),
    "sends nothing but checkpoints": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        out, said = found("Training")._out, {"checkpoint": {"iteration": 0, "steps": 1, "seconds": 0.1}}
        while True:
            modules["evaluation.sandbox.frames"].write_message(out, said, [b"state"])
            modules["time"].sleep(5)
    return 1.0
""",
    ),
    "says that it lives, and nothing else": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        out, said = found("Training")._out, {"alive": {"steps": 1, "seconds": 0.1}}
        while True:
            modules["evaluation.sandbox.frames"].write_message(out, said)
            modules["time"].sleep(0.5)
    return 1.0
""",
    ),
    "blames the platform": (
        "reward_stuck",
        """
def reward_function(params):
    if trainer:
        fault = {"code": "sandbox_unavailable", "params": {}}
        modules["evaluation.sandbox.frames"].write_message(found("Training")._out, {"error": fault})
    return 1.0
""",
    ),
    "puts its own in the place of ours": (
        "reward_raised",
        """
def mine(self, *arguments):
    raise RuntimeError("not yours")  # here


def reward_function(params):
    if trainer:
        modules["training.trainer.cars"].TrainingCars.harvest = mine
    return 1.0
""",
    ),
    "takes the numbers out of the network": (
        "training_diverged",
        """
def reward_function(params):
    if trainer:
        for weights in found("Learner").model.policy.parameters():
            weights.data.fill_(float("nan"))
    return 1.0
""",
    ),
}
STOPS_THE_CLOCK = (
    REACH
    + """
if trainer:
    modules["time"].monotonic = lambda: 5.0
    trainer.Training._may_go_on = lambda self: True
    modules["training.rewards.sandbox.call_limits"].watch.must_halt = lambda: False


def reward_function(params):
    return 1.0
"""
)


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


@pytest.mark.parametrize("case", one_of_each(CASES, kind=lambda case: case.split("/")[0]))
def test_a_hostile_training_ends_with_code_and_line(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # longer than the seconds of the processor that a call has, also where it gets half of one
    monkeypatch.setattr(client, "_SILENCE_S", 5.0 if case in SILENT else 15.0)
    text = source(case)
    before = descriptors(), children()
    with pytest.raises(UserFault) as fault:
        train(spec(text), Heard())
    assert fault.value.code == OTHERWISE.get(case, case.split("/")[0]), fault.value.__notes__
    assert fault.value.params.get("line") in marked_lines(text)
    assert not is_left(before), "something was left open or running"
    assert list(tmp_path.iterdir()) == [], "something was written"


@pytest.mark.parametrize("case", one_of_each(IN_TRAINING_ONLY, kind=lambda case: IN_TRAINING_ONLY[case][0]))
def test_a_failure_only_in_training_is_the_functions_fault(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Never ours: our faults are tried again, and cost no minutes."""
    monkeypatch.setattr(client, "_SILENCE_S", 15.0)
    monkeypatch.setattr(client, "_MESSAGE_S", 5.0)
    monkeypatch.setattr(client, "_FINISH_S", 4.0)
    code, text = IN_TRAINING_ONLY[case][0], REACH + IN_TRAINING_ONLY[case][1]
    before, heard = (descriptors(), children()), Heard()
    with pytest.raises(UserFault) as fault:
        train(spec(text, stop_seconds=8.0), heard)
    assert fault.value.code == code, (str(fault.value), fault.value.__notes__)
    assert fault.value.params.get("line") in {None, *marked_lines(text)}
    assert not is_left(before)
    assert all(one.values["eval_lap_ms"] != 1 for one in heard.iterations)


@pytest.mark.parametrize(("stop", "why"), [(False, "time"), pytest.param(True, "stopped", marks=pytest.mark.soak)])
def test_a_function_stopping_the_clock_gets_no_more_time(stop, why, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "_FINISH_S", 4.0)
    monkeypatch.setattr(client, "_OVERTIME_S", 30.0)  # of a busy host
    heard, began = Heard(), time.monotonic()
    asked = {"asked_to_stop": lambda: bool(heard.iterations)} if stop else {}
    ended = train(spec(STOPS_THE_CLOCK, stop_seconds=600.0 if stop else 2.0, stop_steps=None), heard, **asked)
    took = time.monotonic() - began
    assert (ended.why, ended.sb3_zip) == (why, b""), "it was cut off"
    assert heard.iterations, "with what it had learned"
    assert 0.5 * took < ended.seconds <= took, "counted by our clock"


def test_a_patched_simulator_spoils_only_its_own_training() -> None:
    """It makes the trainer say that every step is a whole lap. The evaluation that counts happens elsewhere."""
    heard = Heard()
    train(spec(SAYS_IT_LAPS, stop_steps=500), heard)
    assert heard.iterations
    assert max(iteration.values["eval_progress"] for iteration in heard.iterations) == 100.0
    race = RaceRules.of_an_episode(max_simulated_ms=20_000)
    job = RaceJob(OVAL, race, heard.iterations[-1].onnx, METADATA)
    outcome = evaluate(job)
    assert outcome.metrics["metrics"][0]["completion_percentage"] < 100
    assert evaluate(job).trace_sha256 == outcome.trace_sha256
    assert "percent" in inspect.getsource(referee.Referee.percent.fget), "it reached this process"


def test_a_neighbouring_training_learns_the_same_as_alone() -> None:
    """Two processes share nothing: the honest one's numbers do not move."""
    honest = "def reward_function(params):\n    return float(params['all_wheels_on_track'])\n"
    alone, beside = Heard(), Heard()
    train(spec(honest, stop_steps=200), alone)
    with pytest.raises(UserFault):
        train(spec(source("reward_raised/kills_everybody")), Heard())
    train(spec(honest, stop_steps=200), beside)
    first, second = ([one.values["mean_reward"] for one in heard.iterations] for heard in (alone, beside))
    assert first == second
    assert first
