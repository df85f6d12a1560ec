"""Nothing that comes out of the trainer's process is believed: a stranger's Python ran in it."""

from __future__ import annotations

import contextlib
import gzip
import json
import math
import os
import threading
import time
from typing import Any

import pytest

from evaluation.sandbox.frames import FrameError, write_frame, write_message
from evaluation.sandbox.process import SandboxedProcess
from paddock.errors import PaddockError, PlatformFault, UserFault
from paddock.simulator.trace import COLUMNS
from tests.training.jobs import GOOD
from training.rewards.sandbox.call_limits import KEPT_CHARACTERS, LAST_CHARACTERS
from training.trainer import client
from training.trainer.client import Listener, train
from training.trainer.messages import _TRIALS, Prints, bounds_of
from training.trainer.spec import TrainerSpec


class FakeProcess:
    """A process whose every word a test chooses; ``says`` writes to the pipe that the client reads."""

    def __init__(self, limits: Any) -> None:
        self.limits = limits
        self.stdout, self.says = os.pipe()
        self._their_in, self.stdin = os.pipe()
        self.status: int | None = 0
        self.cpu, self.wants = 0.0, False
        self.inner_pid: int | None = None
        self._speaker: threading.Thread | None = None

    widen_pipes = SandboxedProcess.widen_pipes
    wait_for_lock = SandboxedProcess.wait_for_lock

    def __enter__(self) -> FakeProcess:
        return self

    def __exit__(self, *_: object) -> None:
        for fd in (self.stdout, self.stdin, self._their_in):
            os.close(fd)
        if self._speaker is not None:
            self._speaker.join(5)
        if self.says is not None:
            os.close(self.says)

    def say(self, *frames: bytes) -> None:
        """Write frames; more than the pipe takes at once, in a thread."""
        if sum(map(len, frames)) < 32_000:
            for frame in frames:
                write_frame(self.says, frame)
        else:
            self._speaker = threading.Thread(target=self._speak, args=(frames,), daemon=True)
            self._speaker.start()

    def _speak(self, frames: tuple[bytes, ...]) -> None:
        with contextlib.suppress(OSError, FrameError):
            for frame in frames:
                write_frame(self.says, frame)

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
        self.saved: list[Any] = []
        self.lived: list[float] = []

    def alive(self, steps, seconds) -> None:
        self.lived.append(seconds)

    def checkpoint(self, state) -> None:
        self.saved.append(state)

    def iteration(self, iteration) -> None:
        self.heard.append(iteration)

    def printed(self, prints) -> None:
        self.heard.append(prints)


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

    def run(script, stop=lambda: False, **changes: Any) -> tuple[Any, Ear]:
        def launch(module, *, limits, arguments, level, random):
            process = FakeProcess(limits)
            write_message(process.says, {"ready": {}})
            script(process)
            return process

        monkeypatch.setattr(client, "launch", launch)
        ear = Ear()
        return train(spec(**changes), ear, asked_to_stop=stop), ear

    return run


def fault_of(hear, script, **changes: Any) -> PaddockError:
    with pytest.raises(PaddockError) as raised:
        hear(script, **changes)
    return raised.value


def iterate(
    process: FakeProcess, changes: dict[str, Any] | None = None, network: bytes = b"onnx", trace: bytes = b""
) -> None:
    said = {"iteration": {**GOOD, **(changes or {})}, "driving": [[0.0, 0.0, 0.0, 1.0]]}
    process.say(json.dumps({**said, "blobs": [len(network), len(trace)]}).encode(), network, trace)


def test_a_valid_iteration_and_end_are_passed_on(hear):
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
def test_a_malformed_iteration_ends_the_attempt(hear, changes):
    assert fault_of(hear, lambda process: iterate(process, changes)).code == "reward_stuck"


def test_non_finite_numbers_are_refused(hear):
    assert fault_of(hear, lambda process: iterate(process, {"eval_reward": math.nan})).code == "reward_stuck"


def test_nonsense_without_a_strangers_function_is_our_fault(hear):
    assert fault_of(hear, lambda process: iterate(process, {"number": 0}), reward_code="").code == "trainer_protocol"


def test_values_out_of_range_are_clipped(hear):
    def script(process):
        iterate(process, {"eval_progress": 400.0, "eval_clean_laps": 99, "eval_trials": GOOD["eval_trials"] * 50})
        write_message(process.says, {"done": "time", "steps": 1, "seconds": 1.0}, [b"zip"])

    _, ear = hear(script)
    values = ear.heard[0].values
    assert (values["eval_progress"], values["eval_clean_laps"], len(values["eval_trials"])) == (100.0, _TRIALS, _TRIALS)


@pytest.mark.parametrize(
    ("done", "zipped"),
    [
        ({"done": "fame", "steps": 1}, b"zip"),
        ({"done": "time", "steps": 0}, b"zip"),
        ({"done": "time", "steps": -1}, b"zip"),
        ({"done": "time"}, b"zip"),
        ({"done": "time", "steps": 1}, b""),
    ],
)
def test_a_malformed_end_is_refused(hear, done, zipped):
    def script(process):
        iterate(process)
        write_message(process.says, done, [zipped])

    assert fault_of(hear, script).code == "reward_stuck"


def test_an_end_without_a_network_is_refused(hear):
    def script(process):
        write_message(process.says, {"done": "time", "steps": 1}, [b"zip"])

    assert fault_of(hear, script).code == "reward_stuck"


@pytest.mark.parametrize(("numbers", "before"), [((7, 9), 6), ((7,), 0), ((7,), 7), ((1,), 3)])
def test_iterations_follow_the_last_checkpoint_one_by_one(hear, numbers, before):
    def script(process):
        for number in numbers:
            iterate(process, {"number": number})

    assert fault_of(hear, script, iterations_before=before).code == "reward_stuck"


def test_impossibly_fast_iterations_are_a_flood(hear, monkeypatch):
    monkeypatch.setattr(client, "_ITERATIONS_AT_ONCE", 2)
    monkeypatch.setattr(client, "_ITERATIONS_A_SECOND", 0.0)

    def script(process):
        for number in range(1, 4):
            iterate(process, {"number": number})

    assert fault_of(hear, script).code == "reward_stuck"


def test_too_many_iterations_are_a_flood(hear, monkeypatch):
    monkeypatch.setattr(client, "_ITERATIONS", 3)

    def script(process):
        for number in range(1, 5):
            iterate(process, {"number": number})

    assert fault_of(hear, script).code == "reward_stuck"


def test_too_many_checkpoints_are_a_flood(hear):
    def script(process):
        iterate(process)
        for _ in range(4):
            write_message(process.says, {"checkpoint": {"iteration": 1, "steps": 1, "seconds": 1.0}}, [b"state"])

    assert fault_of(hear, script).code == "reward_stuck"


@pytest.mark.parametrize("before", [0, 4])
def test_a_checkpoint_before_any_learning_is_refused(hear, before):
    """Frames of nothing else held the only trainer for as long as they came."""

    def script(process):
        write_message(process.says, {"checkpoint": {"iteration": before, "steps": 1, "seconds": 1.0}}, [b"state"])

    assert fault_of(hear, script, iterations_before=before).code == "reward_stuck"


def test_a_blob_larger_than_its_network_allows_is_refused(hear):
    heaviest = bounds_of(spec())

    def network(process):
        iterate(process, network=bytes(heaviest.network + 1))

    def checkpoint(process):
        iterate(process)
        about = {"checkpoint": {"iteration": 1, "steps": 1, "seconds": 1.0}, "blobs": [heaviest.state + 1]}
        process.say(json.dumps(about).encode(), bytes(heaviest.state + 1))

    def end(process):
        iterate(process)
        done = {"done": "time", "steps": 1, "seconds": 1.0, "blobs": [heaviest.state + 1]}
        process.say(json.dumps(done).encode(), bytes(heaviest.state + 1))

    assert heaviest.state < 4_000_000, "of 0.8 MB of weights"
    assert [fault_of(hear, script).code for script in (network, checkpoint, end)] == ["reward_stuck"] * 3


def test_a_training_stopped_before_its_first_iteration_keeps_both_files(hear):
    """A resumed training has the optimiser's state: its stable-baselines3 file is as large as a checkpoint."""
    heaviest = bounds_of(spec())
    sb3_zip, network = bytes(heaviest.state), bytes(heaviest.network)

    def script(process):
        done = {"done": "stopped", "steps": 1, "seconds": 1.0, "blobs": [len(sb3_zip), len(network)]}
        process.say(json.dumps(done).encode(), sb3_zip, network)

    ended, _ = hear(script, iterations_before=1)
    assert (ended.why, ended.sb3_zip, ended.network) == ("stopped", sb3_zip, network)


def test_a_checkpoint_of_another_iteration_is_refused(hear):
    def script(process):
        iterate(process)
        write_message(process.says, {"checkpoint": {"iteration": 9, "steps": 1, "seconds": 1.0}}, [b"state"])

    assert fault_of(hear, script).code == "reward_stuck"


def prints(process: FakeProcess, kept: Any, last: Any = "", more: Any = False) -> None:
    write_message(process.says, {"printed": {"kept": kept, "last": last, "more": more}})


class TestPrints:
    def test_prints_are_passed_on_as_plain_lines(self, hear):
        def script(process):
            prints(process, "step 1\n\x1b[2J\u202e\ud800\x00\n", "\ttwo\n", "yes")
            iterate(process)
            write_message(process.says, {"done": "time", "steps": 1, "seconds": 1.0}, [b"zip"])

        _, ear = hear(script)
        assert ear.heard[0] == Prints("step 1\n?[2J???\n", "\ttwo\n", False)

    @pytest.mark.parametrize(
        ("kept", "last"), [(1, ""), ("", None), ("x" * (KEPT_CHARACTERS + 1), ""), ("", "x" * (LAST_CHARACTERS + 1))]
    )
    def test_malformed_prints_are_refused(self, hear, kept, last):
        assert fault_of(hear, lambda process: prints(process, kept, last)).code == "reward_stuck"

    def test_prints_beyond_the_limit_are_refused(self, hear):
        def script(process):
            for _ in range(3):
                prints(process, "x" * (KEPT_CHARACTERS // 2))

        assert fault_of(hear, script).code == "reward_stuck"

    def test_endless_prints_are_a_flood(self, hear):
        def script(process):
            for _ in range(30):
                prints(process, "", "again\n")

        assert fault_of(hear, script).code == "reward_stuck"


class TestSimTraces:
    CSV = (",".join(COLUMNS) + "\n").encode()

    @pytest.mark.parametrize(
        "trace",
        [
            b"no gzip",
            gzip.compress(b"name,of,another\n"),
            gzip.compress(CSV + bytes(8_000_000)),
            gzip.compress(CSV) + gzip.compress(bytes(100)),
            gzip.compress(CSV)[:-4],
            gzip.compress(CSV + os.urandom(3_000_000), 0),
        ],
        ids=["text", "another table", "bomb", "two files", "cut off", "too large"],
    )
    def test_a_trace_that_does_not_unpack_to_csv_is_refused(self, hear, trace):
        assert fault_of(hear, lambda process: iterate(process, trace=trace)).code == "reward_stuck"

    def test_a_valid_trace_is_passed_on(self, hear):
        packed = gzip.compress(self.CSV + b"1,2\n")

        def script(process):
            iterate(process, trace=packed)
            write_message(process.says, {"done": "time", "steps": 1}, [b"zip"])

        _, ear = hear(script)
        assert ear.heard[0].simtrace == packed


class TestOurClock:
    """All seconds are measured outside: the function could stop the clock of its own process."""

    def test_the_reported_seconds_are_ours(self, hear):
        def script(process):
            iterate(process, {"seconds": 0.0})
            write_message(process.says, {"checkpoint": {"iteration": 1, "steps": 1, "seconds": 0.0}}, [b"state"])
            write_message(process.says, {"done": "time", "steps": 1, "seconds": 0.0}, [b"zip"])

        ended, ear = hear(script, seconds_before=30.0)
        assert 30.0 <= ear.heard[0].values["seconds"] <= round(ear.saved[0].seconds, 3)  # rounded, too
        assert ear.saved[0].seconds <= ended.seconds < 60.0

    def test_a_process_past_its_time_is_ended(self, hear, monkeypatch):
        monkeypatch.setattr(client, "_FINISH_S", 0.5)
        ended, _ = hear(iterate, stop_seconds=0.5)
        assert (ended.why, ended.sb3_zip) == ("time", b"")

    def test_a_process_that_ignores_a_stop_is_ended(self, hear, monkeypatch):
        monkeypatch.setattr(client, "_FINISH_S", 0.5)
        ended, _ = hear(iterate, stop=lambda: True)
        assert (ended.why, ended.sb3_zip) == ("stopped", b"")

    def test_a_process_that_ends_without_an_answer_is_blamed(self, hear, monkeypatch):
        monkeypatch.setattr(client, "_FINISH_S", 0.3)
        assert fault_of(hear, lambda process: None, stop=lambda: True).code == "reward_stuck"

    def test_a_process_that_gets_no_cpu_is_given_time(self, hear, monkeypatch):
        monkeypatch.setattr(client, "_FINISH_S", 0.1)
        monkeypatch.setattr(client, "_OVERTIME_S", 0.8)

        def starved(process):
            process.wants = True

        began = time.monotonic()
        assert fault_of(hear, starved, stop=lambda: True).code == "reward_stuck"
        assert time.monotonic() - began > 0.8

    def test_time_is_reported_whatever_the_process_says(self, hear, monkeypatch):
        monkeypatch.setattr(client, "_FINISH_S", 0.3)
        monkeypatch.setattr(client, "_REPORT_EVERY_S", 0.1)
        _, ear = hear(iterate, stop=lambda: True, seconds_before=30.0)
        assert ear.lived == sorted(ear.lived) and 30.0 <= ear.lived[0] < 30.3 < ear.lived[-1]


def test_the_listeners_own_error_is_not_blamed_on_the_function(hear, monkeypatch):
    def broken(self, iteration):
        raise KeyError("a column of ours")

    monkeypatch.setattr(Ear, "iteration", broken)
    with pytest.raises(KeyError):
        hear(iterate)


def test_an_empty_network_is_refused(hear):
    assert fault_of(hear, lambda process: iterate(process, network=b"")).code == "reward_stuck"


def test_a_huge_frame_is_not_read(hear):
    def script(process):
        os.write(process.says, (2**31).to_bytes(4, "little"))

    assert fault_of(hear, script).code == "reward_stuck"


@pytest.mark.parametrize("code", ["platform_gave_up", "no_such_code", None, "policy_died", ["x"]])
def test_the_process_may_report_only_certain_codes(hear, code):
    def script(process):
        write_message(process.says, {"error": {"code": code, "params": {}}})

    assert fault_of(hear, script).code == "reward_stuck"


def test_reward_errors_come_with_their_line(hear):
    def script(process):
        params = {"line": 3, "error": "x" * 9000, "more": {"nested": 1}}
        write_message(process.says, {"error": {"code": "reward_raised", "params": params}})

    fault = fault_of(hear, script)
    assert isinstance(fault, UserFault)
    assert (fault.params["line"], len(fault.params["error"]), "more" in fault.params) == (3, 500, False)
    assert "a traceback" in fault.__notes__[0]


@pytest.mark.parametrize(
    ("status", "code"),
    [
        (72, "training_memory"),
        (0, "reward_stuck"),
        (73, "reward_stuck"),
        (-11, "reward_stuck"),
        (-40, "reward_stuck"),
        (137, "reward_stuck"),  # a status that looks like a signal
        (-31, "reward_stuck"),
        (-9, "trainer_died"),  # which it cannot send itself: the host is short of memory
        (-15, "trainer_died"),
    ],
)
def test_the_exit_status_tells_why_it_died(hear, status, code):
    assert fault_of(hear, lambda process: process.ends(status)).code == code


def test_our_own_default_is_never_blamed_for_an_exit(hear):
    assert isinstance(fault_of(hear, lambda process: process.ends(0), reward_code=""), PlatformFault)


class TestSilentProcess:
    @pytest.fixture(autouse=True)
    def impatient(self, monkeypatch):
        monkeypatch.setattr(client, "_SILENCE_S", 0.3)
        monkeypatch.setattr(client, "_PATIENCE_S", 1.0)

    def test_a_sleeping_process_is_the_reward_functions_fault(self, hear):
        assert fault_of(hear, lambda process: None).code == "reward_stuck"

    def test_a_process_that_gets_no_cpu_is_our_fault(self, hear):
        def script(process):
            process.wants = True

        began = time.monotonic()
        assert fault_of(hear, script).code == "host_overloaded"
        assert time.monotonic() - began > 1.0
