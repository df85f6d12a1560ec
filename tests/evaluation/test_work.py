"""A worker's turn, with a pipeline that the test plays."""

from __future__ import annotations

import gzip
import os
import signal
import threading

import pytest
from django.db import DatabaseError
from django.utils import timezone

from core.jobs import heartbeat
from evaluation import tasks
from evaluation.models import Evaluation, Result, State, WorkerNode
from evaluation.running import pipeline
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.services import queue_evaluation, stop_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from evaluation.sandbox import probe as probing
from paddock.errors import PlatformFault, UserFault
from paddock.rules.race import RaceRules
from paddock.simulator.engine import ENGINE_ID
from tests.evaluation.stubs import finishes, outcome_of, trace_csv
from tests.rows import model_row

pytestmark = pytest.mark.django_db(transaction=True)  # the heartbeat runs in another thread


@pytest.fixture
def queued(alice, oval, wakes):
    return queue_evaluation(
        owner=alice, model=model_row(alice), track=oval, rules=RaceRules(seed=3, direction="cw"), now=timezone.now()
    )


@pytest.fixture
def plays(monkeypatch):
    """Make the pipeline do something else."""
    return lambda play: monkeypatch.setattr(pipeline, "evaluate", play)


@pytest.fixture
def quick_beats(monkeypatch, settings):
    monkeypatch.setattr(EVALUATIONS, "beat_s", 0.01)
    settings.LEASE_SECONDS = 1


def run():
    return run_next_evaluation(worker="w")


class TestOneEvaluation:
    def test_a_finished_run_has_its_result_and_trace(self, queued, plays, settings):
        jobs = []

        def play(job, on_progress, should_stop, wall_limit_s, pool):
            jobs.append((job, wall_limit_s))
            return outcome_of(laps=(10_000, 9_500, 4_000), unfinished=True)

        plays(play)
        assert run()
        queued.refresh_from_db()
        assert queued.state == State.FINISHED
        assert queued.worker == "w"
        result = queued.result
        assert (result.complete_laps, result.best_lap_ms, result.total_ms) == (2, 9_500, 23_500)
        assert (result.off_tracks, result.resets, result.end_reason) == (3, 3, "time_up")
        with result.trace.open() as file:
            assert gzip.decompress(file.read()) == trace_csv(laps=3)
        ((job, wall_limit_s),) = jobs
        assert job.onnx == b"a network"
        assert (job.rules.seed, job.track.direction) == (3, "cw")
        assert job.metadata == queued.model.metadata
        assert wall_limit_s == settings.EVALUATION_WALL_SECONDS

    def test_a_models_fault_fails_the_run(self, queued, plays):
        def play(*args, **kwargs):
            fault = UserFault("policy_died", step=3, how="signal 11")
            fault.add_note("stderr of the policy:\nsegmentation fault")
            raise fault

        plays(play)
        assert run()
        queued.refresh_from_db()
        assert (queued.state, queued.reason_code) == (State.FAILED, "policy_died")
        assert "segmentation fault" in queued.operator_detail
        assert not run()

    @pytest.mark.parametrize(
        "error", [PlatformFault("storage_failed"), RuntimeError("a bug"), MemoryError(), OSError("disk")]
    )
    def test_our_fault_is_retried_and_never_given_up(self, queued, plays, error):
        def play(*args, **kwargs):
            raise error

        plays(play)
        for attempt in range(1, 8):
            assert run()
            queued.refresh_from_db()
            assert (queued.state, queued.attempt) == (State.QUEUED, attempt)
            Evaluation.objects.update(not_before=None)  # its pause is over
        assert type(error).__name__ in queued.operator_detail

    def test_a_run_that_fails_once_has_one_result_in_the_end(self, queued, plays):
        plays(lambda *args, **kwargs: 1 / 0)
        run()
        plays(finishes)
        run()
        queued.refresh_from_db()
        assert (queued.state, queued.attempt) == (State.FINISHED, 2)
        assert Result.objects.count() == 1

    def test_a_lost_network_file_is_our_fault(self, queued, plays):
        plays(finishes)
        network = queued.model.network
        network.onnx.storage.delete(network.onnx.name)
        run()
        queued.refresh_from_db()
        assert queued.state == State.QUEUED
        assert "file_damaged" in queued.operator_detail

    def test_a_job_whose_track_changed_is_our_fault(self, queued, plays):
        plays(finishes)
        Evaluation.objects.update(spec={**queued.spec, "track": "0" * 64})
        run()
        queued.refresh_from_db()
        assert queued.state == State.QUEUED
        assert "internal_error" in queued.operator_detail

    def test_an_owners_stop_takes_effect_at_the_next_heartbeat(self, queued, plays, quick_beats):
        noticed = []

        def play(job, on_progress, should_stop, wall_limit_s, pool):
            stop_evaluation(evaluation=queued, now=timezone.now())
            on_progress({"lap": 1})
            wait_until(should_stop)
            noticed.append(True)
            raise UserFault("stopped")

        plays(play)
        assert run()
        assert noticed
        queued.refresh_from_db()
        assert (queued.state, queued.reason_code) == (State.STOPPED, "stopped")
        assert not Result.objects.exists()

    def test_a_stopping_worker_returns_its_run_to_its_place(self, queued, plays):
        told = threading.Event()

        def play(job, on_progress, should_stop, wall_limit_s, pool):
            assert not should_stop()
            told.set()
            assert should_stop()
            raise UserFault("stopped")

        plays(play)
        assert run_next_evaluation(worker="w", interrupted=told.is_set)
        queued.refresh_from_db()
        assert (queued.state, queued.attempt) == (State.QUEUED, 0)


class TestHeartbeat:
    def test_it_writes_the_progress_and_extends_the_lease(self, queued, plays, quick_beats):
        seen = []

        def play(job, on_progress, should_stop, wall_limit_s, pool):
            before = Evaluation.objects.get().leased_until
            on_progress({"lap": 2, "percent": 40.0})
            wait_until(lambda: Evaluation.objects.get().progress)
            seen.append((Evaluation.objects.get().progress, Evaluation.objects.get().leased_until > before))
            return outcome_of()

        plays(play)
        run()
        assert seen == [({"lap": 2, "percent": 40.0}, True)]

    def test_it_continues_without_any_progress(self, queued, plays, quick_beats):
        def play(job, on_progress, should_stop, wall_limit_s, pool):
            before = Evaluation.objects.get().leased_until
            wait_until(lambda: Evaluation.objects.get().leased_until > before)
            return outcome_of()

        plays(play)
        run()
        queued.refresh_from_db()
        assert queued.state == State.FINISHED

    def test_it_survives_a_short_database_outage(self, queued, plays, quick_beats, monkeypatch):
        calls = []

        def failing_twice(**kwargs):
            calls.append(1)
            if len(calls) <= 2:
                raise DatabaseError("away")
            return True

        def play(job, on_progress, should_stop, wall_limit_s, pool):
            wait_until(lambda: on_progress({"lap": 1}) or len(calls) > 3)
            assert not should_stop()
            return outcome_of()

        monkeypatch.setattr(EVALUATIONS, "beat", failing_twice)
        plays(play)
        run()
        queued.refresh_from_db()
        assert queued.state == State.FINISHED

    def test_it_gives_up_after_a_database_outage_of_a_lease(self, queued, plays, quick_beats, monkeypatch, settings):
        settings.LEASE_SECONDS = 0.1
        noticed = []

        def failing(**kwargs):
            raise DatabaseError("away")

        def play(job, on_progress, should_stop, wall_limit_s, pool):
            wait_until(should_stop)
            noticed.append(True)
            raise UserFault("stopped")

        monkeypatch.setattr(EVALUATIONS, "beat", failing)
        plays(play)
        run()
        assert noticed
        queued.refresh_from_db()
        assert (queued.state, queued.attempt) == (State.QUEUED, 1)
        assert "lease_expired" in queued.operator_detail
        assert not Result.objects.exists()

    def test_it_writes_at_most_once_a_second(self, settings):
        assert EVALUATIONS.beat_s >= 1.0
        assert settings.LEASE_SECONDS / heartbeat.BEATS_PER_LEASE >= settings.LEASE_SECONDS / 6


class TestTask:
    def test_it_works_until_nothing_waits(self, queued, alice, oval, wakes, plays):
        plays(finishes)
        for _ in range(2):
            queue_evaluation(owner=alice, model=queued.model, track=oval, rules=RaceRules(), now=timezone.now())
        assert tasks.work.apply().get() == 3
        assert set(Evaluation.objects.values_list("state", flat=True)) == {State.FINISHED}

    def test_it_sends_a_wake_up_when_its_time_is_up(self, queued, alice, oval, wakes, plays, monkeypatch):
        plays(finishes)
        queue_evaluation(owner=alice, model=queued.model, track=oval, rules=RaceRules(), now=timezone.now())
        monkeypatch.setattr(tasks, "BUDGET_S", 0.0)
        wakes.clear()
        assert tasks.work.apply().get() == 1
        assert len(wakes) == 1
        assert EVALUATIONS.sweep(now=timezone.now(), wake=False).waiting == 1

    def test_it_requeues_runs_of_lost_workers(self, queued, plays):
        plays(finishes)
        EVALUATIONS.claim(worker="dead", now=timezone.now() - timezone.timedelta(hours=1))
        assert tasks.work.apply().get() == 1
        queued.refresh_from_db()
        assert (queued.state, queued.attempt) == (State.FINISHED, 2)

    def test_it_records_the_worker_and_its_sandbox(self, queued, plays):
        plays(finishes)
        tasks.work.apply()
        node = WorkerNode.objects.get()
        assert node.engine == ENGINE_ID
        assert node.sandbox["level"] == probing.probe().level

    def test_it_runs_nothing_below_the_minimum_sandbox(self, queued, plays, monkeypatch, caplog):
        plays(finishes)
        monkeypatch.setattr(
            probing,
            "probe",
            lambda: probing.SandboxReport([probing.Layer("Landlock", False, "not in this kernel")], 0, 2),
        )
        monkeypatch.setattr(tasks, "_refusal", "")
        assert [tasks.work.apply().get() for _ in range(3)] == [0, 0, 0]
        queued.refresh_from_db()
        assert queued.state == State.QUEUED
        assert not WorkerNode.objects.get().sandbox["sufficient"]
        assert caplog.text.count("runs nothing") == 1

    def test_sigterm_hands_back_and_claims_no_more(self, queued, alice, oval, plays):
        queue_evaluation(owner=alice, model=queued.model, track=oval, rules=RaceRules(), now=timezone.now())

        def play(job, on_progress, should_stop, wall_limit_s, pool):
            assert not should_stop()
            os.kill(os.getpid(), signal.SIGTERM)
            assert should_stop()
            raise UserFault("stopped")

        plays(play)
        before = signal.getsignal(signal.SIGTERM)
        assert tasks.work.apply().get() == 1
        assert signal.getsignal(signal.SIGTERM) is before
        assert list(Evaluation.objects.values_list("state", "attempt")) == [(State.QUEUED, 0)] * 2

    def test_the_sweep_reports_what_it_found(self, queued, wakes):
        EVALUATIONS.claim(worker="dead", now=timezone.now() - timezone.timedelta(hours=1))
        assert tasks.sweep.apply().get() == {"requeued": 1, "waiting": 1}


def wait_until(holds, limit_s=10.0):
    """Poll ``holds`` until it is true."""
    done = threading.Event()
    for _ in range(int(limit_s / 0.005)):
        if holds():
            return
        done.wait(0.005)
    raise AssertionError("it never came true")
