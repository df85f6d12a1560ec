"""Nothing that comes out of the trainer's process is believed: a stranger's Python ran in it."""

from __future__ import annotations

import json
import math
import os
import time
from typing import Any

import pytest

from evaluation.sandbox.frames import write_frame, write_message
from faults import PaddockError, PlatformFault, UserFault
from training.trainer import client
from training.trainer.client import Listener, train
from training.trainer.spec import TrainerSpec

GOOD = {
    "number": 1,
    "steps": 100,
    "seconds": 1.0,
    "steps_per_second": 100.0,
    "episodes": [{"episode": 0, "reward": 1.0, "progress": 5.0, "status": "Off track", "steps": 9, "time_ms": 600}],
    "mean_reward": 1.0,
    "mean_progress": 5.0,
    "eval_trials": [
        {"reward": 1.0, "progress": 5.0, "status": "Off track", "steps": 9, "time_ms": 600, "lap_ms": None}
    ],
    "eval_progress": 5.0,
    "eval_reward": 1.0,
    "eval_lap_ms": None,
    "eval_clean_laps": 0,
    "entropy": 1.6,
    "policy_loss": 0.0,
    "value_loss": 1.0,
    "is_best": True,
    "confirmed": False,
}


class FakeProcess:
    """A process whose every word a test chooses; ``says`` writes to the pipe that the client reads."""

    def __init__(self, limits: Any) -> None:
        self.limits = limits
        self.stdout, self.says = os.pipe()
        self._their_in, self.stdin = os.pipe()
        self.status: int | None = 0
        self.cpu, self.wants = 0.0, False
        self.inner_pid: int | None = None

    def __enter__(self) -> FakeProcess:
        return self

    def __exit__(self, *_: object) -> None:
        for fd in (self.stdout, self.stdin, self._their_in):
            os.close(fd)
        if self.says is not None:
            os.close(self.says)

    def ends(self, status: int) -> None:
        os.close(self.says)
        self.says, self.status = None, status

    def wait(self, timeout: float | None = None) -> int | None:
        return self.status

    def cpu_seconds(self) -> float:
        return self.cpu

    def wants_processor(self) -> bool:
        return self.wants

    def stderr_text(self) -> str:
        return "a traceback"


class Ear(Listener):
    def __init__(self) -> None:
        self.heard: list[Any] = []

    def iteration(self, iteration) -> None:
        self.heard.append(iteration)


def spec(**changes: Any) -> TrainerSpec:
    metadata = {
        "action_space_type": "discrete",
        "action_space": [{"steering_angle": 0.0, "speed": 1.0}],
        "sensor": ["FRONT_FACING_CAMERA"],
        "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    }
    values = {"batch_size": 64, "num_episodes_between_training": 5}
    return TrainerSpec({}, "time_trial", metadata, "ppo", values, **({"reward_code": "x"} | changes))


@pytest.fixture
def hear(monkeypatch):
    """Run the client against a process that does what ``script`` says."""

    def run(script, **changes: Any) -> tuple[Any, Ear]:
        def launch(module, *, limits, arguments, level, random):
            process = FakeProcess(limits)
            write_message(process.says, {"ready": {}})
            script(process)
            return process

        monkeypatch.setattr(client, "launch", launch)
        ear = Ear()
        return train(spec(**changes), ear), ear

    return run


def fault_of(hear, script, **changes: Any) -> PaddockError:
    with pytest.raises(PaddockError) as raised:
        hear(script, **changes)
    return raised.value


def iterate(process: FakeProcess, changes: dict[str, Any] | None = None, network: bytes = b"onnx") -> None:
    said = {"iteration": {**GOOD, **(changes or {})}, "driving": [[0.0, 0.0, 0.0, 1.0]], "blobs": [len(network), 0]}
    write_frame(process.says, json.dumps(said).encode())
    write_frame(process.says, network)
    write_frame(process.says, b"")


def test_a_good_iteration_and_a_good_end(hear):
    def script(process):
        iterate(process)
        write_message(process.says, {"done": "clean_laps", "steps": 100, "seconds": 1.5}, [b"zip"])

    ended, ear = hear(script)
    assert (ended.why, ended.steps, ended.sb3_zip) == ("clean_laps", 100, b"zip")
    assert ear.heard[0].values["eval_progress"] == 5.0
    assert "confirmed" not in ear.heard[0].values, "only what is known goes on"


@pytest.mark.parametrize(
    "changes",
    [
        {"number": 0},
        {"number": "1"},
        {"steps": -1},
        {"steps": 2**40},
        {"seconds": "soon"},
        {"eval_reward": 1e300},
        {"eval_reward": None},
        {"mean_reward": [1]},
        {"episodes": {"a": 1}},
        {"episodes": [{"reward": 1.0}]},
        {"eval_trials": 3},
        {"eval_lap_ms": -5},
    ],
)
def test_an_iteration_of_another_form_ends_the_attempt(hear, changes):
    assert fault_of(hear, lambda process: iterate(process, changes)).code == "trainer_protocol"


def test_numbers_that_are_not_finite_are_no_numbers(hear):
    assert fault_of(hear, lambda process: iterate(process, {"eval_reward": math.nan})).code == "trainer_protocol"


def test_what_is_out_of_range_is_cut_off(hear):
    def script(process):
        iterate(process, {"eval_progress": 400.0, "eval_clean_laps": 99, "eval_trials": GOOD["eval_trials"] * 50})
        write_message(process.says, {"done": "fame", "steps": 1, "seconds": 1.0}, [b""])

    ended, ear = hear(script)
    values = ear.heard[0].values
    assert (values["eval_progress"], values["eval_clean_laps"], len(values["eval_trials"])) == (100.0, 10, 10)
    assert ended.why == "time"


def test_a_network_of_no_bytes_is_none(hear):
    assert fault_of(hear, lambda process: iterate(process, network=b"")).code == "trainer_protocol"


def test_a_huge_frame_is_not_read(hear):
    def script(process):
        os.write(process.says, (2**31).to_bytes(4, "little"))

    assert fault_of(hear, script).code == "trainer_protocol"


@pytest.mark.parametrize("code", ["platform_gave_up", "no_such_code", None, "policy_died", ["x"]])
def test_it_can_only_blame_what_it_may(hear, code):
    def script(process):
        write_message(process.says, {"error": {"code": code, "params": {}}})

    assert fault_of(hear, script).code == "trainer_protocol"


def test_its_own_faults_come_with_the_line(hear):
    def script(process):
        params = {"line": 3, "error": "x" * 9000, "more": {"nested": 1}}
        write_message(process.says, {"error": {"code": "reward_raised", "params": params}})

    fault = fault_of(hear, script)
    assert isinstance(fault, UserFault)
    assert (fault.params["line"], len(fault.params["error"]), "more" in fault.params) == (3, 500, False)
    assert "a traceback" in fault.__notes__[0]


@pytest.mark.parametrize(
    ("status", "code"), [(72, "training_memory"), (0, "reward_stuck"), (-9, "trainer_died"), (73, "trainer_died")]
)
def test_why_it_died(hear, status, code):
    assert fault_of(hear, lambda process: process.ends(status)).code == code


def test_our_own_default_is_never_blamed_for_an_exit(hear):
    assert isinstance(fault_of(hear, lambda process: process.ends(0), reward_code=""), PlatformFault)


class TestSilence:
    @pytest.fixture(autouse=True)
    def impatient(self, monkeypatch):
        monkeypatch.setattr(client, "_SILENCE_S", 0.3)
        monkeypatch.setattr(client, "_PATIENCE_S", 1.0)

    def test_of_one_that_sleeps_is_the_reward_functions(self, hear):
        assert fault_of(hear, lambda process: None).code == "reward_stuck"

    def test_of_one_that_does_not_get_the_processor_is_ours(self, hear):
        def script(process):
            process.wants = True

        began = time.monotonic()
        assert fault_of(hear, script).code == "host_overloaded"
        assert time.monotonic() - began > 1.0
