"""A model in its process: what it answers, and what becomes of one that misbehaves."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace
from functools import partial

import numpy as np
import onnxruntime
import pytest

from evaluation.sandbox import policy as policy_module
from evaluation.sandbox.limits import POLICY
from evaluation.sandbox.policy import PolicyProcess
from paddock.errors import PlatformFault, UserFault

from .conftest import PAYLOADS
from .networks import CAMERA, HEADER, console_sized_network, constant_network, small_network

pytestmark = [pytest.mark.usefixtures("nothing_left"), pytest.mark.any_level]
GREY = {CAMERA: np.full((120, 160, 1), 100, np.uint8)}
USES_UP = ("burn", "flood_of_replies", "ignore_signals", "crash", "grow")  # after which others could have less
BRISK = {"step_deadline_s": 0.2, "overage_s": 0.2, "total_s": 5.0}


def picture(seed):
    return {CAMERA: np.random.default_rng(seed).integers(0, 256, (120, 160, 1), dtype=np.uint8)}


def hostile(kind, level, **options):
    options = {"limits": replace(POLICY, address_space_mb=512), **options}
    return PolicyProcess(module="policies", arguments=[kind], python_path=[PAYLOADS], level=level, **options)


def drive(policy, onnx=b"", budget=BRISK, steps=6):
    """Load and ask ``steps`` times, as a referee does. Raises what an evaluation would."""
    policy.load(onnx, HEADER)
    client = policy.client(HEADER, **budget)
    try:
        return [client(GREY) for _ in range(steps)]
    except UserFault as fault:
        raise policy.explain(fault) from None


def assert_a_normal_model_still_drives(level):
    with PolicyProcess(level=level) as policy:
        answers = drive(policy, small_network(), budget={})
    assert len(answers) == 6
    assert len({answer.tobytes() for answer in answers}) == 1


@pytest.mark.parametrize("made", [small_network, partial(small_network, channels_first=True), console_sized_network])
def test_a_model_answers_as_onnxruntime_does_outside(level, made):
    onnx = made()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(onnx, options, providers=["CPUExecutionProvider"])
    shape = session.get_inputs()[0].shape
    with PolicyProcess(level=level) as policy:
        version = policy.load(onnx, HEADER)
        client = policy.client(HEADER)
        for seed in range(5):
            (expected,) = session.run(None, {CAMERA: picture(seed)[CAMERA].reshape(shape)})
            np.testing.assert_array_equal(client(picture(seed)), expected[0])
    assert version == onnxruntime.__version__
    assert client.step == 5
    assert client.seconds > 0


def test_answers_are_bit_identical_across_levels_and_processes():
    from evaluation.sandbox.probe import probe

    answers = set()
    for level in range(2, probe().level + 1):
        for _ in range(2):
            with PolicyProcess(level=level) as policy:
                policy.load(console_sized_network(), HEADER)
                answers.add(policy.client(HEADER)(picture(1)).tobytes())
    assert len(answers) == 1


def test_an_answer_does_not_change_when_the_next_arrives():
    with PolicyProcess() as policy:
        policy.load(small_network(), HEADER)
        client = policy.client(HEADER)
        first = client(picture(0))
        kept = first.copy()
        client(picture(1))
        np.testing.assert_array_equal(first, kept)


ENDS = [
    ("never_reads", "policy_late"),
    ("sleep", "policy_late"),
    ("burn", "policy_late"),
    ("ignore_signals", "policy_late"),
    ("half_a_reply", "policy_late"),
    ("half_a_reply_and_death", "policy_died"),
    ("two_replies", "policy_protocol"),
    ("another_step", "policy_protocol"),
    ("unknown_way", "policy_protocol"),
    ("exact_then_late", "policy_late_exact"),
    ("flood_of_replies", "policy_protocol"),
    ("not_a_number", "non_finite_action"),
    ("infinity", "non_finite_action"),
    ("close_and_run_on", "policy_died"),
    ("return_nothing", "policy_died"),
    ("return_three", "policy_died"),
    ("crash", "policy_died"),
    ("abort", "policy_died"),
    ("grow", "policy_memory"),
]


@pytest.mark.parametrize(("kind", "code"), ENDS)
def test_a_misbehaving_policy_ends_with_its_reason(level, kind, code):
    started = time.monotonic()
    with hostile(kind, level) as policy, pytest.raises(UserFault) as caught:
        drive(policy, budget={} if kind == "grow" else BRISK)  # clearing half a gigabyte takes a while
    assert caught.value.code == code
    assert "?" not in str(caught.value), "a parameter of the sentence is missing"
    if "step" in caught.value.params:
        assert caught.value.params["step"] == (1 if kind == "never_reads" else 3)
    assert time.monotonic() - started < 10
    if kind in USES_UP:
        assert_a_normal_model_still_drives(level)


@pytest.mark.soak
@pytest.mark.parametrize("kind", [kind for kind, _ in ENDS if kind not in USES_UP])
def test_a_normal_model_still_drives_after_any_other(level, kind):
    with hostile(kind, level) as policy, pytest.raises(UserFault):
        drive(policy)
    assert_a_normal_model_still_drives(level)


@pytest.mark.parametrize(
    ("kind", "how"),
    [
        ("crash", "SIGSEGV"),
        ("abort", "SIG"),
        ("return_three", "exit status 3"),
        ("close_and_run_on", "ran on"),
    ],
)
def test_the_reason_tells_how_a_policy_died(level, kind, how):
    with hostile(kind, level) as policy, pytest.raises(UserFault) as caught:
        drive(policy)
    assert how in caught.value.params["how"]


def test_a_policy_killed_by_the_host_is_not_the_racers_fault(level):
    """The kernel does so when memory runs out. No locked process can send itself that signal."""
    with PolicyProcess(level=level) as policy:
        drive(policy, small_network())
        os.kill(policy.process.inner_pid, signal.SIGKILL)
        with pytest.raises(UserFault) as caught:
            policy.client(HEADER)(GREY)
        fault = policy.explain(caught.value)
    assert (fault.code, fault.fault) == ("host_overloaded", "platform")


@pytest.mark.parametrize("kind", ["flood_stderr", "slow_once", "huge_values"])
def test_odd_but_timely_finite_answers_are_accepted(level, kind):
    with hostile(kind, level) as policy:
        answers = drive(policy, budget={"step_deadline_s": 0.2, "overage_s": 5.0, "total_s": 20.0})
    assert len(answers) == 6


def test_slow_steps_use_up_the_overage(level):
    with hostile("slow_once", level) as policy, pytest.raises(UserFault) as caught:
        drive(policy, budget={"step_deadline_s": 0.1, "overage_s": 0.05, "total_s": 20.0})
    assert caught.value.code == "policy_late"


def test_a_network_waiting_for_a_busy_host_is_not_slow(level, monkeypatch):
    """A stopped clock stands for a host that gives the network no time."""
    with hostile("burn", level) as policy, pytest.raises(PlatformFault) as caught:
        monkeypatch.setattr(policy.process, "cpu_seconds", lambda: 0.0)
        drive(policy)
    assert caught.value.code == "host_overloaded"


def test_a_network_that_sleeps_cannot_blame_the_host(level, monkeypatch):
    with hostile("sleep", level) as policy, pytest.raises(UserFault) as caught:
        monkeypatch.setattr(policy.process, "cpu_seconds", lambda: 0.0)
        drive(policy)
    assert caught.value.code == "policy_late"


def test_the_total_time_of_all_steps_is_limited(level):
    with hostile("slow_once", level) as policy, pytest.raises(UserFault) as caught:
        drive(policy, budget={"step_deadline_s": 1.0, "overage_s": 10.0, "total_s": 0.2})
    assert caught.value.code == "policy_late"


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("never_ready", "policy_late"),
        ("dies_loading", "policy_died"),
        ("junk_for_ready", "policy_protocol"),
        ("frame_too_large_for_ready", "policy_protocol"),
        ("no_json_for_ready", "policy_protocol"),
        ("refuses_with_a_novel", "policy_refused"),
    ],
)
def test_a_policy_misbehaving_on_load_is_the_racers_fault(level, kind, code, monkeypatch):
    monkeypatch.setattr(policy_module, "LOAD_S", 0.5)
    with hostile(kind, level) as policy, pytest.raises(UserFault) as caught:
        drive(policy)
    assert caught.value.code == code
    assert len(str(caught.value)) < 500


def test_unprintable_text_does_not_leave_a_policy(level):
    """A NUL byte, half a surrogate pair, a terminal's colours, a turned direction of writing."""
    with hostile("refuses_with_poison", level) as policy, pytest.raises(UserFault) as caught:
        policy.load(b"", HEADER)
    assert caught.value.params == {"detail": "???[31m?", "version": "??"}
    with hostile("ready_with_poison", level) as policy:
        assert policy.load(b"", HEADER) == "???"


@pytest.mark.parametrize("module", ["never_imports", "has_a_thread"])
def test_a_process_failing_before_its_lock_is_our_fault(level, module):
    with (
        PolicyProcess(module=module, python_path=[PAYLOADS], level=level) as policy,
        pytest.raises(PlatformFault) as caught,
    ):
        policy.load(small_network(), HEADER)
    assert caught.value.code == "sandbox_failed"
    assert any("Traceback" in note for note in caught.value.__notes__), "operators see the process's last words"
    assert "Traceback" not in str(caught.value)


@pytest.mark.parametrize(
    ("onnx", "part"),
    [
        (b"", "the runtime cannot load"),
        (b"not an onnx file", "the runtime cannot load"),
        (small_network()[:-9], "the runtime cannot load"),
        (small_network(outputs=4), "not one row of 3 values"),
    ],
    ids=["empty", "text", "truncated", "too many outputs"],
)
def test_a_network_that_fails_to_load_or_fit_is_refused(level, onnx, part):
    with PolicyProcess(level=level) as policy, pytest.raises(UserFault) as caught:
        policy.load(onnx, HEADER)
    assert caught.value.code == "policy_refused"
    assert part.lower() in str(caught.value).lower()


def test_a_refused_network_gives_its_reason_despite_an_early_end(level):
    with PolicyProcess(level=level) as policy:
        policy.give(b"not an onnx file")
        assert policy.process.wait(10.0) == 0
        with pytest.raises(UserFault) as caught:
            policy.agree(HEADER)
    assert caught.value.code == "policy_refused"
    assert "the runtime cannot load" in str(caught.value).lower()


def test_a_network_with_another_input_is_refused(level):
    header = {"inputs": [{"name": "LIDAR", "dtype": "float32", "shape": [64]}], "outputs": 3}
    with PolicyProcess(level=level) as policy, pytest.raises(UserFault) as caught:
        policy.load(small_network(), header)
    assert caught.value.code == "policy_refused"
    assert "LIDAR" in caught.value.params["detail"]


def test_a_network_for_another_picture_size_is_refused(level):
    header = {"inputs": [{"name": CAMERA, "dtype": "uint8", "shape": [60, 80, 1]}], "outputs": 3}
    with PolicyProcess(level=level) as policy, pytest.raises(UserFault) as caught:
        policy.load(small_network(), header)
    assert caught.value.code == "policy_refused"


def test_a_network_in_onnxruntimes_own_format_is_refused(level, tmp_path):
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(tmp_path / "model.ort")
    options.add_session_config_entry("session.save_model_format", "ORT")
    onnxruntime.InferenceSession(small_network(), options, providers=["CPUExecutionProvider"])
    with PolicyProcess(level=level) as policy, pytest.raises(UserFault) as caught:
        policy.load((tmp_path / "model.ort").read_bytes(), HEADER)
    assert caught.value.code == "policy_refused"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_a_network_answering_nan_gets_that_reason(level, value):
    with PolicyProcess(level=level) as policy, pytest.raises(UserFault) as caught:
        drive(policy, constant_network((value, 0.0, 0.0)))
    assert caught.value.code == "non_finite_action"
    assert caught.value.params == {"step": 1}


def test_a_network_too_large_for_memory_gets_that_reason(level):
    limits = replace(POLICY, address_space_mb=190)
    with PolicyProcess(level=level, limits=limits) as policy, pytest.raises(UserFault) as caught:
        policy.load(console_sized_network(), HEADER)
    assert caught.value.code == "policy_memory"
    assert caught.value.params == {"limit_mb": 190}


@pytest.mark.parametrize(
    "observation",
    [
        {},
        {"LIDAR": GREY[CAMERA]},
        {CAMERA: GREY[CAMERA], "LIDAR": GREY[CAMERA]},
        {CAMERA: GREY[CAMERA].astype(np.float32)},
        {CAMERA: GREY[CAMERA][:, :, 0]},
    ],
)
def test_an_unagreed_observation_is_a_programming_error(observation):
    with PolicyProcess() as policy:
        policy.load(small_network(), HEADER)
        with pytest.raises(ValueError):
            policy.client(HEADER)(observation)


def test_a_console_sized_network_fits_with_room_to_spare(level):
    with PolicyProcess(level=level) as policy:
        drive(policy, console_sized_network(), budget={})
        assert 60 < policy.process.peak_mb() < 300


def test_a_policy_starts_quickly(level):
    took = []
    for _ in range(3):
        started = time.monotonic()
        with PolicyProcess(level=level) as policy:
            policy.load(small_network(), HEADER)
            took.append(time.monotonic() - started)
    assert min(took) < 1.5  # 0.1 s on an idle machine
