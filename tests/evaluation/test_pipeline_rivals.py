"""Several submitted cars in the sandbox: each has a process of its own, and one that fails retires."""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import asdict, replace

import pytest

from evaluation.running import process_pool as crew_module
from evaluation.running.pipeline import PolicyBudget, RaceJob, RivalModel, evaluate
from evaluation.running.process_pool import ProcessPool, SparePool
from evaluation.sandbox.policy import PolicyProcess
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import BoxPlace, RaceRules
from tests.evaluation.test_pipeline_faults import runner  # noqa: F401
from tests.sandbox.conftest import PAYLOADS, level, nothing_left  # noqa: F401
from tests.sandbox.networks import METADATA, constant_network, small_network
from tests.soak import one_of_each

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("nothing_left")]
BRISK = PolicyBudget(step_deadline_s=0.3, overage_s=0.7, total_s=20.0)
STEP = 50


@pytest.fixture(scope="module")
def oval():
    return by_slug("oval").geometry()


@pytest.fixture
def job(oval):
    """Ten seconds of two untrained networks that are asked in nearly every step: faults cost no time."""
    rules = RaceRules(race_type="head_to_head", max_simulated_ms=10_000, off_track_penalty_ms=0, collision_penalty_ms=0)
    return RaceJob(oval, rules, small_network(), METADATA, (RivalModel(small_network(seed=1), METADATA),))


@pytest.fixture
def policies(monkeypatch):
    """Puts payloads in the place of policy processes: one kind for each car, None for the real one."""

    def replace_with(*kinds, step=STEP):
        left = list(kinds)

        def start(**options):
            kind = left.pop(0)
            if kind is None:
                return PolicyProcess(**options)
            return PolicyProcess(module="policies", arguments=[kind, str(step)], python_path=[PAYLOADS], **options)

        monkeypatch.setattr(crew_module, "PolicyProcess", start)

    return replace_with


@pytest.fixture
def not_starved(monkeypatch):
    """However busy this host is, whoever burns processor time and is late is slow."""
    monkeypatch.setattr(PolicyProcess, "_starved", lambda policy, waited_s: False)


def same(outcome):
    """Everything in an outcome that must not differ between runs."""
    measured = ("wall_s", "shares", "peak_mb")
    return {name: value for name, value in asdict(outcome).items() if name not in measured}


class TestSeveralCars:
    def test_every_car_has_its_laps_and_trace(self, job, level):  # noqa: F811
        outcome = evaluate(job, level=level)
        (rival,) = outcome.rivals
        assert sorted(outcome.order) == [0, 1]
        assert outcome.retired is None and rival.retired is None
        assert outcome.end_reason == rival.end_reason == "time_up"
        assert outcome.laps and rival.laps and rival.metrics["metrics"]
        assert outcome.trace_sha256 != rival.trace_sha256
        assert len(outcome.trace_csv.splitlines()) == len(rival.trace_csv.splitlines()) > 100
        assert outcome.versions["onnxruntime"]
        assert outcome.shares["network"] <= outcome.shares["policy"] + 0.04
        traces = {"trace_csv", "rivals"}
        json.dumps({name: value for name, value in asdict(outcome).items() if name not in traces}, allow_nan=False)

    def test_four_cars_race(self, job):
        rivals = tuple(RivalModel(small_network(seed=seed), METADATA) for seed in (1, 2, 3))
        outcome = evaluate(replace(job, rivals=rivals))
        assert sorted(outcome.order) == [0, 1, 2, 3]
        assert len({outcome.trace_sha256, *(rival.trace_sha256 for rival in outcome.rivals)}) == 4

    def test_memory_of_all_processes_is_added_up(self, job):
        assert evaluate(job).peak_mb > evaluate(replace(job, rivals=())).peak_mb + 30

    def test_a_ready_crew_drives_the_same_race(self, job):
        spare = SparePool()
        spare.prepare()
        pool = spare.take(job.venue)
        assert len(pool.policies) == 1
        assert same(evaluate(job, pool=pool)) == same(evaluate(job))
        assert not pool.alive

    def test_each_car_has_its_own_sensors_and_actions(self, job):
        metadata = {
            **METADATA,
            "action_space_type": "continuous",
            "action_space": {"steering_angle": {"low": -30.0, "high": 30.0}, "speed": {"low": 0.5, "high": 2.0}},
        }
        rival = RivalModel(constant_network((0.0, -1.0)), metadata)
        outcome = evaluate(replace(job, rivals=(rival,)))
        rows = outcome.rivals[0].trace_csv.decode().splitlines()[2:5]
        assert {row.split(",")[6] for row in rows} == {"0.5"}

    @pytest.mark.parametrize("where", ["on_progress", "should_stop"])
    def test_a_callers_error_propagates_and_leaves_nothing_running(self, job, where):
        class LeaseLost(Exception):
            pass

        def lose(*_):
            raise LeaseLost

        with pytest.raises(LeaseLost):
            evaluate(job, **{where: lose})

    def test_a_stop_soon_ends_the_run(self, job):
        asked = []
        long = replace(job, rules=replace(job.rules, laps=1000, max_simulated_ms=10_000_000))
        started = time.monotonic()
        with pytest.raises(UserFault) as caught:
            evaluate(long, should_stop=lambda: asked.append(0) or len(asked) > 5)
        assert caught.value.code == "stopped"
        assert time.monotonic() - started < 15

    def test_a_process_that_does_not_start_ends_the_others(self, job, policies, monkeypatch):
        started = []

        def fail_at_the_second(**options):
            if started:
                raise PlatformFault("sandbox_failed", detail="no more processes")
            started.append(PolicyProcess(**options))
            return started[0]

        monkeypatch.setattr(crew_module, "PolicyProcess", fail_at_the_second)
        with pytest.raises(PlatformFault):
            evaluate(job)
        assert started[0].process.poll() is not None

    def test_policies_share_no_pipe(self):
        with ProcessPool(3) as pool:
            for policy in pool.policies:
                policy._wait_for_lock()
            held = []
            for policy in pool.policies:
                folder = f"/proc/{policy.process.inner_pid}/fd"
                try:
                    names = [os.readlink(f"{folder}/{fd}") for fd in os.listdir(folder)]
                except PermissionError:
                    pytest.skip("only root may look into a locked process")
                held.append({name for name in names if name.startswith("pipe:")})
            assert all(pipes for pipes in held)
            assert not held[0] & held[1] and not held[1] & held[2] and not held[0] & held[2]

    @pytest.mark.parametrize(
        ("rules", "code"),
        [
            (RaceRules(), "rivals_race_type"),
            (RaceRules(race_type="head_to_head", bots=2), "rivals_with_bots"),
        ],
    )
    def test_a_race_type_without_rivals_is_refused_before_starting(self, job, rules, code):
        with pytest.raises(UserFault) as caught:
            replace(job, rules=rules)
        assert caught.value.code == code

    def test_boxes_without_room_are_the_racers_fault(self, oval):
        rules = RaceRules(race_type="object_avoidance", boxes=(BoxPlace(0.0, "inner"),))
        with pytest.raises(UserFault) as caught:
            evaluate(RaceJob(oval, rules, small_network(), METADATA))
        assert caught.value.code == "box_on_start_line"


class TestFailingCar:
    @pytest.mark.parametrize(
        ("kind", "code"),
        one_of_each(
            [
                ("crash", "policy_died"),
                ("abort", "policy_died"),
                ("return_nothing", "policy_died"),
                ("close_and_run_on", "policy_died"),
                ("half_a_reply_and_death", "policy_died"),
                ("burn", "policy_late"),
                ("half_a_reply", "policy_late"),
                ("ignore_signals", "policy_late"),
                ("two_replies", "policy_protocol"),
                ("another_step", "policy_protocol"),
                ("flood_of_replies", "policy_protocol"),
                ("not_a_number", "non_finite_action"),
                ("infinity", "non_finite_action"),
                ("grow", "policy_memory"),
            ],
            kind=lambda case: case[1],
        ),
    )
    def test_it_retires_and_the_other_drives_on(self, job, policies, not_starved, kind, code):
        policies(None, kind)
        started = time.monotonic()
        outcome = evaluate(job, budget=PolicyBudget() if kind == "grow" else BRISK)
        (rival,) = outcome.rivals
        assert rival.end_reason == "retired"
        assert rival.retired["code"] == code
        assert rival.retired["params"].get("step", STEP) == STEP
        assert outcome.end_reason == "time_up" and outcome.retired is None
        assert outcome.simulated_ms == job.rules.max_simulated_ms
        assert outcome.order == [0, 1]
        assert time.monotonic() - started < 20

    def test_the_first_car_may_fail(self, job, policies):
        policies("crash", None)
        outcome = evaluate(job)
        assert outcome.retired == {"code": "policy_died", "params": {"step": STEP, "how": "SIGSEGV"}}
        assert outcome.end_reason == "retired"
        assert outcome.rivals[0].end_reason == "time_up" and outcome.rivals[0].retired is None
        assert outcome.order == [1, 0]
        assert outcome.simulated_ms == job.rules.max_simulated_ms
        assert len(outcome.rivals[0].trace_csv.splitlines()) > len(outcome.trace_csv.splitlines())

    def test_all_cars_may_fail(self, job, policies):
        policies("crash", "not_a_number")
        outcome = evaluate(job)
        assert outcome.retired["code"] == "policy_died"
        assert outcome.rivals[0].retired["code"] == "non_finite_action"
        assert outcome.end_reason == outcome.rivals[0].end_reason == "retired"
        assert sorted(outcome.order) == [0, 1]

    def test_the_way_of_failing_does_not_affect_the_others(self, job, policies):
        outcomes = []
        for kind in ("crash", "not_a_number", "two_replies", "half_a_reply"):
            policies(None, kind)
            outcomes.append(evaluate(job, budget=BRISK))
        assert len({outcome.trace_sha256 for outcome in outcomes}) == 1
        assert len({outcome.rivals[0].trace_sha256 for outcome in outcomes}) == 1

    def test_a_retired_car_takes_no_cpu_from_the_others(self, job, policies, not_starved):
        policies(None, "burn")
        pool = ProcessPool(2)
        running = []
        evaluate(job, budget=BRISK, pool=pool, on_progress=lambda _: running.append(pool.policies[1].process.poll()))
        assert running[0] is None
        assert running[-1] == -signal.SIGKILL

    @pytest.mark.parametrize(
        ("kind", "code"),
        [
            ("dies_loading", "policy_died"),
            ("junk_for_ready", "policy_protocol"),
            ("refuses_with_poison", "policy_refused"),
        ],
    )
    def test_a_car_failing_at_the_start_retires_unmoved(self, job, policies, kind, code):
        policies(None, kind)
        outcome = evaluate(job)
        (rival,) = outcome.rivals
        assert (rival.end_reason, rival.retired["code"]) == ("retired", code)
        assert len(rival.trace_csv.splitlines()) == 2  # the header and where it stood
        assert outcome.end_reason == "time_up"

    def test_a_car_whose_network_and_actions_disagree_retires(self, job):
        outcome = evaluate(replace(job, onnx=small_network(outputs=5)))
        assert outcome.retired["code"] == "policy_refused"
        assert outcome.rivals[0].end_reason == "time_up"
        assert outcome.versions["onnxruntime"]

    def test_a_race_where_all_fail_at_the_start_has_a_result(self, job):
        broken = small_network(outputs=5)
        outcome = evaluate(replace(job, onnx=broken, rivals=(RivalModel(broken, METADATA),)))
        assert [outcome.retired["code"], outcome.rivals[0].retired["code"]] == ["policy_refused"] * 2

    def test_a_car_killed_by_the_host_leaves_no_result(self, job):
        """The kernel kills with SIGKILL when the host's memory runs out, and a policy cannot send itself one."""
        pool = ProcessPool(2)
        long = replace(job, rules=replace(job.rules, max_simulated_ms=600_000))

        def kill(_progress):
            if pool.policies[1].process.poll() is None:
                os.kill(pool.policies[1].process.inner_pid, signal.SIGKILL)

        with pytest.raises(PlatformFault) as caught:
            evaluate(long, pool=pool, on_progress=kill)
        assert caught.value.code == "host_overloaded"

    def test_a_car_starved_of_cpu_leaves_no_result(self, job, policies, monkeypatch):
        monkeypatch.setattr(PolicyProcess, "_starved", lambda policy, waited_s: True)
        policies(None, "half_a_reply")
        with pytest.raises(PlatformFault) as caught:
            evaluate(job, budget=BRISK)
        assert caught.value.code == "host_overloaded"

    def test_slowness_within_the_budget_affects_nobody(self, job, policies):
        traces = set()
        for kind in ("flood_stderr", "slow_once"):
            policies(None, kind)
            outcome = evaluate(job)
            traces.add((outcome.trace_sha256, outcome.rivals[0].trace_sha256, outcome.rivals[0].end_reason))
        assert len(traces) == 1
        assert traces.pop()[2] == "time_up"

    def test_each_car_has_its_own_budget(self, job, policies):
        """Together they need more than one has, and neither more than its own."""
        policies("slow_once", "slow_once")
        outcome = evaluate(job, budget=PolicyBudget(step_deadline_s=0.05, overage_s=0.4, total_s=20.0))
        assert outcome.retired is None and outcome.rivals[0].retired is None


def test_the_runners_time_limit_grows_with_the_cars(job, runner):  # noqa: F811  it is the fixture
    runner("race:hang")
    with pytest.raises(PlatformFault) as caught:
        evaluate(job, wall_limit_s=1.5)
    assert (caught.value.code, caught.value.params) == ("runner_timeout", {"limit_s": 3.0})
