"""One evaluation from end to end: real simulator, real network, real sandbox."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, replace

import pytest

from evaluation.running import pipeline
from evaluation.running.pipeline import RaceJob, evaluate
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from paddock.network.bound import NetworkFacts
from paddock.network.policy_wire import EXACT
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from tests.sandbox.conftest import level, nothing_left  # noqa: F401
from tests.sandbox.networks import METADATA, console_sized_network, constant_network, small_network

pytestmark = pytest.mark.usefixtures("nothing_left")


@pytest.fixture(scope="module")
def oval():
    return next(track for track in CATALOGUE if track.slug == "oval").geometry()


@pytest.fixture
def job(oval):
    """Half a minute of an untrained network on the oval."""
    return RaceJob(oval, RaceRules(max_simulated_ms=30_000), small_network(), METADATA)


def test_an_evaluation_reports_what_was_driven(job, level):  # noqa: F811
    outcome = evaluate(job, level=level)
    assert outcome.engine == ENGINE_ID
    assert outcome.end_reason == "time_up"
    assert outcome.simulated_ms == 30_000
    assert outcome.laps
    assert outcome.metrics["metrics"]
    assert len(outcome.trace_csv.splitlines()) > 400
    assert set(outcome.versions) >= {"pybullet", "numpy", "opencv", "onnxruntime"}
    assert outcome.cpu_model
    json.dumps({name: value for name, value in asdict(outcome).items() if name != "trace_csv"}, allow_nan=False)


def test_the_wall_clock_time_is_accounted_for(job):
    outcome = evaluate(job)
    parts = ("start", "physics", "camera", "policy", "other")
    assert sum(outcome.shares[name] for name in parts) == pytest.approx(outcome.wall_s)
    assert all(outcome.shares[name] > 0 for name in parts)
    assert outcome.shares["network"] <= outcome.shares["policy"] + 0.02  # a hundredth each of two clocks


@pytest.mark.slow
def test_a_broken_bound_repeats_the_whole_run(job):
    exactly = evaluate(replace(job, facts=NetworkFacts(bound=None).to_dict()))
    assert [sum(ways) for ways in exactly.ways] == [ways[EXACT] for ways in exactly.ways]
    assert 100 < exactly.ways[0][EXACT] < exactly.steps  # in a pause nobody asks
    trusting = evaluate(replace(job, facts=NetworkFacts(bound=0.0).to_dict()))
    assert trusting.inexact == [0]
    assert trusting.trace_sha256 == exactly.trace_sha256
    assert evaluate(job).inexact == []


@pytest.mark.slow
def test_five_runs_across_all_levels_give_one_trace(job):
    from evaluation.sandbox.probe import probe

    levels = [*range(2, probe().level + 1)] * 5
    outcomes = [evaluate(job, level=level) for level in levels[:5]]  # noqa: F811
    assert len({outcome.trace_sha256 for outcome in outcomes}) == 1
    assert len({outcome.trace_csv for outcome in outcomes}) == 1
    assert len({json.dumps(outcome.laps) for outcome in outcomes}) == 1


def test_another_network_gives_another_trace(job):
    other = replace(job, onnx=small_network(seed=1))
    assert evaluate(job).trace_sha256 != evaluate(other).trace_sha256


def test_a_continuous_action_space_drives(job):
    metadata = {
        **METADATA,
        "action_space_type": "continuous",
        "action_space": {"steering_angle": {"low": -30.0, "high": 30.0}, "speed": {"low": 0.5, "high": 2.0}},
    }
    outcome = evaluate(replace(job, metadata=metadata, onnx=constant_network((0.3, 1.0))))
    assert outcome.simulated_ms > 0


def test_a_network_of_the_consoles_size_stays_under_600_mb(job):
    outcome = evaluate(replace(job, onnx=console_sized_network()))
    assert 150 < outcome.peak_mb < 600


def test_progress_is_reported_during_a_run(job):
    seen = []
    outcome = evaluate(job, on_progress=seen.append)
    assert 2 <= len(seen) <= 20  # every 15 steps, but no more often than twice a second
    assert [progress["total_ms"] for progress in seen] == sorted(progress["total_ms"] for progress in seen)
    assert seen[-1]["total_ms"] == outcome.simulated_ms
    assert seen[0]["laps"] == 3


def test_a_stop_soon_ends_the_run(job):
    asked = []

    def should_stop():
        asked.append(time.monotonic())
        return len(asked) > 3

    long = replace(job, rules=RaceRules(laps=1000, max_simulated_ms=10_000_000))
    started = time.monotonic()
    with pytest.raises(UserFault) as caught:
        evaluate(long, should_stop=should_stop)
    assert caught.value.code == "stopped"
    assert time.monotonic() - started < 10


def test_a_stop_before_the_start_is_heeded(job):
    with pytest.raises(UserFault) as caught:
        evaluate(job, should_stop=lambda: True)
    assert caught.value.code == "stopped"


@pytest.mark.parametrize("where", ["on_progress", "should_stop"])
def test_a_callers_error_propagates_and_leaves_nothing_running(job, where):
    class LeaseLost(Exception):
        pass

    def lose(*_):
        raise LeaseLost

    with pytest.raises(LeaseLost):
        evaluate(job, **{where: lose})


def test_a_network_answering_nan_is_the_racers_fault(job, level):  # noqa: F811
    with pytest.raises(UserFault) as caught:
        evaluate(replace(job, onnx=constant_network((float("nan"), 0.0, 0.0))), level=level)
    assert caught.value.code == "non_finite_action"


def test_an_unfitting_action_list_is_the_racers_fault(job):
    with pytest.raises(UserFault) as caught:
        evaluate(replace(job, onnx=small_network(outputs=5)))
    assert caught.value.code == "policy_refused"


def test_the_callers_cpu_affinity_is_left_alone(job):
    import os

    before = os.sched_getaffinity(0)
    evaluate(job)
    assert os.sched_getaffinity(0) == before


def test_two_simultaneous_evaluations_do_not_affect_each_other(job):
    from concurrent.futures import ThreadPoolExecutor

    other = replace(job, onnx=small_network(seed=1))
    alone = {evaluate(job).trace_sha256, evaluate(other).trace_sha256}
    with ThreadPoolExecutor(2) as pool:
        together = {outcome.trace_sha256 for outcome in pool.map(evaluate, [job, other])}
    assert together == alone


def test_the_pipelines_time_limit_exceeds_a_models_budget():
    assert pipeline.PolicyBudget().total_s * 1.5 < pipeline.WALL_LIMIT_S
