"""Evaluations that end badly: whose fault it is, and that the next one runs as if nothing had been."""

from __future__ import annotations

import contextlib
import functools
import time
from dataclasses import replace

import pytest

from evaluation.running import pipeline
from evaluation.running import process_pool as pool
from evaluation.running.pipeline import PolicyBudget, RaceJob, evaluate
from evaluation.sandbox import probe as probe_module
from evaluation.sandbox.limits import RUNNER
from evaluation.sandbox.policy import PolicyProcess
from evaluation.sandbox.probe import Layer, SandboxReport
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from tests.sandbox.conftest import PAYLOADS, nothing_left  # noqa: F401
from tests.sandbox.networks import METADATA, small_network
from tests.soak import one_of_each

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("nothing_left")]
BRISK = PolicyBudget(step_deadline_s=0.2, overage_s=0.2, total_s=20.0)


@pytest.fixture(scope="module")
def job():
    """A few seconds of an untrained network."""
    oval = next(track for track in CATALOGUE if track.slug == "oval").geometry()
    return RaceJob(oval, RaceRules(max_simulated_ms=3_000), small_network(), METADATA)


def test_to_wait_for_a_core_is_none_of_a_runs_time(job, monkeypatch):
    with pool.ProcessPool() as waiting:

        @contextlib.contextmanager
        def late(*_args):
            waiting.runner.deadline = time.monotonic() - 1.0  # the others drove that long
            yield None

        monkeypatch.setattr(pipeline, "one_core", late)
        assert evaluate(job, pool=waiting).steps > 0


@pytest.fixture(scope="module")
def right(job):
    """The trace of the job when nothing disturbs it."""
    return evaluate(job).trace_sha256


@pytest.fixture
def policy(monkeypatch):
    """Puts a payload in the place of the policy process."""

    def replace_with(kind):
        hostile = functools.partial(PolicyProcess, module="policies", arguments=[kind], python_path=[PAYLOADS])
        monkeypatch.setattr(pool, "PolicyProcess", hostile)

    return replace_with


@pytest.fixture
def runner(monkeypatch):
    """Puts a payload in the place of the runner process."""
    launch = pool.launch

    def replace_with(kind):
        def hostile(_module, *, arguments, **options):
            return launch("runners", arguments=[kind, *arguments], python_path=[PAYLOADS], **options)

        monkeypatch.setattr(pool, "launch", hostile)

    return replace_with


@pytest.mark.parametrize(
    ("kind", "code"),
    one_of_each(
        [
            ("never_reads", "policy_late"),
            ("burn", "policy_late"),
            ("half_a_reply", "policy_late"),
            ("ignore_signals", "policy_late"),
            ("close_and_run_on", "policy_died"),
            ("crash", "policy_died"),
            ("abort", "policy_died"),
            ("return_nothing", "policy_died"),
            ("half_a_reply_and_death", "policy_died"),
            ("two_replies", "policy_protocol"),
            ("another_step", "policy_protocol"),
            ("flood_of_replies", "policy_protocol"),
            ("not_a_number", "non_finite_action"),
            ("infinity", "non_finite_action"),
            ("grow", "policy_memory"),
            ("dies_loading", "policy_died"),
            ("junk_for_ready", "policy_protocol"),
        ],
        kind=lambda case: case[1],
    ),
)
def test_a_misbehaving_policy_does_not_affect_the_next_one(
    job,
    right,
    policy,
    kind,
    code,
    monkeypatch,
):
    policy(kind)
    started = time.monotonic()
    with pytest.raises(UserFault) as caught:
        evaluate(job, budget=PolicyBudget() if kind == "grow" else BRISK)
    assert caught.value.code == code
    assert time.monotonic() - started < 15
    monkeypatch.undo()
    assert evaluate(job).trace_sha256 == right


def test_slowness_within_the_budget_moves_no_lap_time(job, policy):
    """Both answer zeros; one takes 0.3 s over its third answer."""
    traces = set()
    for kind in ("flood_stderr", "slow_once"):
        policy(kind)
        traces.add(evaluate(job).trace_sha256)
    assert len(traces) == 1


def test_the_reason_tells_how_a_policy_died(job, policy):
    policy("crash")
    with pytest.raises(UserFault) as caught:
        evaluate(job)
    assert caught.value.params == {"step": 3, "how": "SIGSEGV"}


@pytest.mark.parametrize(
    ("kind", "code"),
    one_of_each(
        [
            ("start:hang", "sandbox_failed"),
            ("start:crash", "sandbox_failed"),
            ("start:speak_nonsense", "runner_protocol"),
            ("start:unknown_code", "runner_protocol"),
            ("race:hang", "runner_timeout"),
            ("race:hang_within_a_message", "runner_protocol"),
            ("race:crash", "runner_died"),
            ("race:fall_silent", "runner_died"),
            ("race:grow", "runner_died"),
            ("race:speak_nonsense", "runner_protocol"),
            ("race:speak_no_json", "runner_protocol"),
            ("race:announce_too_much", "runner_protocol"),
            ("race:unknown_code", "runner_protocol"),
            ("race:error_of_no_form", "runner_protocol"),
            ("race:incomplete_result", "runner_protocol"),
            ("race:result_without_a_trace", "runner_protocol"),
            ("race:retires_nobody", "runner_protocol"),
        ],
        kind=lambda case: case[1],
    ),
)
def test_a_failing_runner_is_our_fault_with_details_for_operators(job, runner, kind, code, monkeypatch):
    monkeypatch.setattr(pipeline, "_START_S", 1.5)
    monkeypatch.setattr(pipeline, "_MESSAGE_S", 0.5)
    monkeypatch.setattr(pool, "RUNNER", replace(RUNNER, address_space_mb=400))
    runner(kind)
    with pytest.raises(PlatformFault) as caught:
        evaluate(job, wall_limit_s=3.0)
    assert caught.value.code == code
    assert any("last words" in note for note in caught.value.__notes__)
    assert "last words" not in str(caught.value)
    assert "?" not in str(caught.value), "a parameter of the sentence is missing"


@pytest.mark.parametrize(
    "metadata", [{}, {**METADATA, "sensor": ["CRYSTAL_BALL"]}, {**METADATA, "action_space": []}], ids=str
)
def test_invalid_metadata_in_a_job_is_our_fault(job, metadata):
    with pytest.raises(PlatformFault) as caught:
        evaluate(replace(job, metadata=metadata))
    assert caught.value.code == "runner_error"
    assert any("Traceback" in note for note in caught.value.__notes__)


def test_a_runner_that_does_not_start_ends_the_policy_too(job, monkeypatch):
    def fail(*_args, **_options):
        raise PlatformFault("sandbox_failed", detail="no more processes")

    monkeypatch.setattr(pool, "launch", fail)
    with pytest.raises(PlatformFault) as caught:
        evaluate(job)
    assert caught.value.code == "sandbox_failed"


def test_nothing_runs_below_the_minimum(job, monkeypatch):
    weak = SandboxReport(layers=[Layer("Landlock", False, "not in this kernel")], level=1, minimum=2)
    monkeypatch.setattr(probe_module, "probe", lambda: weak)
    with pytest.raises(PlatformFault) as caught:
        evaluate(job)
    assert caught.value.code == "sandbox_unavailable"
    assert caught.value.params == {"level": 1, "minimum": 2}
    assert "not in this kernel" in caught.value.__notes__[0]
