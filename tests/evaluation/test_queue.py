"""Who runs when, and that nobody but the holder of a lease changes anything."""

from __future__ import annotations

import threading
import uuid
from datetime import timedelta

import pytest
from django.core.files.storage import default_storage
from django.db import connection, connections, transaction
from django.test.utils import CaptureQueriesContext

from core.jobs.kinds import SweepReport
from core.wakeups import workers as wakeup
from evaluation.garage.services import delete_model
from evaluation.models import Evaluation, Result, State
from evaluation.running.queue import selectors
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from evaluation.running.queue.services import queue_evaluation, stop_evaluation
from evaluation.running.results import file_names, store_files
from evaluation.signals import evaluation_ended
from paddock.errors import PlatformFault, UserFault
from paddock.rules.race import RaceRules
from tests.evaluation.stubs import outcome_of
from tests.rows import model_row


@pytest.fixture
def submit(oval, wakes, now):
    """Queue an evaluation ``after`` seconds from now; the racer's model is made as needed."""

    def queue(racer, after=0, priority=0):
        model = racer.models.first() or model_row(racer)
        return queue_evaluation(
            owner=racer,
            model=model,
            track=oval,
            rules=RaceRules(),
            priority=priority,
            now=now + timedelta(seconds=after),
        )

    return queue


def claim(now, after=60):
    return EVALUATIONS.claim(worker="w", now=now + timedelta(seconds=after))


def finish(evaluation, now):
    return finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=outcome_of(), now=now)


def run_order(now):
    """The owners of everything in the queue, as one worker would run it, a second each."""
    owners = []
    while (evaluation := claim(now, after=60 + len(owners))) is not None:
        owners.append(evaluation.owner.alias)
        finish(evaluation, now + timedelta(seconds=60 + len(owners)))
    return owners


class TestOrder:
    def test_single_submissions_are_first_come_first_served(self, alice, bob, charlie, submit, now):
        submit(bob, 1)
        submit(alice, 2)
        submit(charlie, 3)
        assert run_order(now) == ["bob", "alice", "charlie"]

    def test_one_racers_flood_delays_others_by_one_run_at_most(self, alice, bob, submit, now):
        for second in range(4):
            submit(alice, second)
        submit(bob, 10)
        submit(bob, 11)
        assert run_order(now) == ["alice", "bob", "alice", "bob", "alice", "alice"]

    def test_the_racer_with_fewer_running_goes_first(self, alice, bob, submit, now):
        for second in range(3):
            submit(alice, second)
        submit(bob, 20)
        assert claim(now, after=5).owner == alice  # bob comes later; alice's first is still running
        assert claim(now).owner == bob
        assert claim(now).owner == alice

    def test_a_higher_priority_always_runs_first(self, alice, bob, submit, now):
        submit(alice, 0)
        submit(alice, 1)
        urgent = submit(bob, 50, priority=1)
        low = submit(bob, 2, priority=-1)
        assert claim(now) == urgent
        assert [claim(now).owner.alias, claim(now).owner.alias] == ["alice", "alice"]
        assert claim(now) == low

    def test_a_requeued_evaluation_keeps_its_place(self, alice, bob, submit, now):
        first = submit(alice, 0)
        submit(bob, 1)
        evaluation = claim(now)
        assert evaluation == first
        EVALUATIONS.release(pk=evaluation.pk, lease=evaluation.lease, now=now)
        assert claim(now) == first

    def test_shown_positions_match_the_order_of_claims(self, alice, bob, charlie, submit, now):
        queued = [submit(alice, s) for s in range(3)] + [submit(bob, 10), submit(charlie, 11), submit(bob, 12)]
        queued.append(submit(charlie, 13, priority=1))
        shown = {selectors.queue_position(evaluation): evaluation.owner.alias for evaluation in queued}
        assert sorted(shown) == [1, 2, 3, 4, 5, 6, 7]
        assert run_order(now) == [shown[place] for place in sorted(shown)]

    def test_a_run_stopped_during_its_claim_is_not_driven(self, alice, bob, submit, now, monkeypatch):
        stopped, following = submit(alice), submit(bob, 1)
        held = EVALUATIONS.held

        def stop_meanwhile(pk, lease):
            if pk == stopped.pk:
                stop_evaluation(evaluation=stopped, now=now)
            return held(pk, lease)

        monkeypatch.setattr(EVALUATIONS, "held", stop_meanwhile)
        assert claim(now) == following
        assert claim(now) is None

    def test_an_empty_queue_has_nothing_to_claim(self, db, now):
        assert claim(now) is None


class TestPosition:
    def test_only_a_waiting_run_has_a_position(self, alice, submit, now):
        submit(alice)
        running = claim(now)
        assert selectors.queue_position(running) is None
        assert selectors.expected_wait_s(running) is None
        assert selectors.queue_length() == 0

    def test_the_expected_wait_follows_recent_runs(self, alice, submit, now, settings):
        settings.WORKER_CONCURRENCY = 2
        submit(alice)
        assert selectors.expected_wait_s(Evaluation.objects.get()) is None  # nothing to judge by yet
        finish(claim(now), now + timedelta(seconds=64))  # claimed at 60
        third = [submit(alice, 100) for _ in range(3)][-1]
        assert selectors.queue_position(third) == 3
        assert selectors.expected_wait_s(third) == pytest.approx(8.0)  # the second round of two workers

    def test_the_expected_wait_reads_the_last_results_before_it_joins_anything(self, alice, submit, now):
        submit(alice)
        finish(claim(now), now + timedelta(seconds=64))
        waiting = submit(alice, 100)
        with CaptureQueriesContext(connection) as queries:
            assert selectors.expected_wait_s(waiting, 1) is not None
        last = [query["sql"] for query in queries if f"LIMIT {selectors.RECENT}" in query["sql"]]
        assert last and not any("JOIN" in sql for sql in last), last

    def test_a_sealed_run_does_not_show_in_what_others_expect_to_wait(self, alice, submit, now):
        submit(alice)
        finish(claim(now), now + timedelta(seconds=64))
        submit(alice, 100)
        slow = claim(now, 200)
        finish(slow, now + timedelta(seconds=300))
        Evaluation.objects.filter(pk=slow.pk).update(sealed=True)
        assert selectors.expected_wait_s(submit(alice, 300), 1) == pytest.approx(4.0)


class TestLease:
    def test_a_result_under_an_old_lease_is_refused(self, alice, submit, now):
        submit(alice)
        slow = claim(now)
        EVALUATIONS.sweep(now=now + timedelta(seconds=120))
        fast = claim(now, after=121)
        assert fast.pk == slow.pk and fast.lease != slow.lease and fast.attempt == 2
        assert not finish(slow, now)
        assert not EVALUATIONS.beat(pk=slow.pk, lease=slow.lease, progress=None, now=now)
        assert finish(fast, now)
        result = Result.objects.get()
        assert result.lease == fast.lease
        assert [name for name in default_storage.listdir("traces")[1] if slow.public_id in name] == [
            file_names(fast)[0].removeprefix("traces/")
        ]

    def test_a_result_overtaken_while_storing_leaves_no_file(self, alice, submit, now, monkeypatch):
        submit(alice)
        evaluation = claim(now)
        from evaluation.running.queue import jobs

        store = jobs.store_files

        def stopped_meanwhile(*arguments):
            name = store(*arguments)
            stop_evaluation(evaluation=Evaluation.objects.get(), now=now)
            return name

        monkeypatch.setattr(jobs, "store_files", stopped_meanwhile)
        assert not finish(evaluation, now)
        assert not default_storage.exists(file_names(evaluation)[0])
        assert not Result.objects.exists()

    def test_a_result_counts_only_once(self, alice, submit, now):
        submit(alice)
        evaluation = claim(now)
        assert finish(evaluation, now)
        assert not finish(evaluation, now)
        assert Result.objects.count() == 1

    def test_a_heartbeat_extends_the_lease(self, alice, submit, now):
        submit(alice)
        evaluation = claim(now, after=0)
        later = now + timedelta(seconds=25)
        assert EVALUATIONS.beat(pk=evaluation.pk, lease=evaluation.lease, progress={"lap": 2}, now=later)
        assert EVALUATIONS.sweep(now=now + timedelta(seconds=50)).requeued == 0
        evaluation.refresh_from_db()
        assert evaluation.progress == {"lap": 2}
        assert EVALUATIONS.sweep(now=now + timedelta(seconds=56)).requeued == 1

    def test_a_foreign_lease_changes_nothing(self, alice, submit, now):
        submit(alice)
        evaluation = claim(now)
        evaluation.lease = uuid.uuid4()
        fault = UserFault("stopped")
        assert not finish(evaluation, now)
        assert not EVALUATIONS.fail(pk=evaluation.pk, lease=evaluation.lease, fault=fault, now=now)
        assert Evaluation.objects.get().state == State.RUNNING

    def test_lost_workers_never_fail_an_evaluation(self, alice, submit, now):
        submit(alice)
        for attempt in range(1, 9):
            now += timedelta(hours=2)
            evaluation = claim(now)
            assert evaluation.attempt == attempt
            assert EVALUATIONS.sweep(now=now + timedelta(seconds=100)).requeued == 1
        evaluation.refresh_from_db()
        assert evaluation.state == State.QUEUED
        assert evaluation.operator_detail.count("lease_expired") == 8

    def test_handing_back_uses_up_no_attempt(self, alice, submit, now):
        submit(alice)
        for _ in range(5):
            evaluation = claim(now)
            assert evaluation.attempt == 1
            assert EVALUATIONS.release(pk=evaluation.pk, lease=evaluation.lease, now=now)

    def test_the_sweep_removes_an_uncommitted_trace(self, alice, submit, now):
        submit(alice)
        evaluation = claim(now)
        (name,) = store_files(evaluation, outcome_of()).traces
        EVALUATIONS.sweep(now=now + timedelta(seconds=100))
        assert not default_storage.exists(name)


class TestEnd:
    def test_the_signal_is_sent_inside_the_transaction(self, alice, submit, now, ended):
        submit(alice)
        evaluation = claim(now)

        def refuse(**kwargs):
            raise RuntimeError("a receiver failed")

        evaluation_ended.connect(refuse)
        try:
            with pytest.raises(RuntimeError):
                finish(evaluation, now)
        finally:
            evaluation_ended.disconnect(refuse)
        assert Evaluation.objects.get().state == State.RUNNING
        assert not Result.objects.exists()
        assert not default_storage.exists(file_names(evaluation)[0])

    def test_the_signal_is_sent_once_per_end(self, alice, submit, now, ended):
        for _ in range(3):
            submit(alice)
        finished, failed = claim(now), claim(now)
        stopped = Evaluation.objects.get(state=State.QUEUED)
        finish(finished, now)
        EVALUATIONS.fail(pk=failed.pk, lease=failed.lease, fault=UserFault("stopped"), now=now)
        stop_evaluation(evaluation=stopped, now=now)
        stop_evaluation(evaluation=stopped, now=now)
        assert [(e.pk, e.state, r is not None) for e, r in ended] == [
            (finished.pk, State.FINISHED, True),
            (failed.pk, State.FAILED, False),
            (stopped.pk, State.STOPPED, False),
        ]

    def test_a_models_fault_fails_at_once_with_its_reason(self, alice, submit, now):
        submit(alice)
        evaluation = claim(now)
        fault = UserFault("policy_late", step=7, step_s=1, overage_s=10, total_s=60)
        EVALUATIONS.fail(pk=evaluation.pk, lease=evaluation.lease, fault=fault, now=now, detail="stderr of the policy")
        evaluation.refresh_from_db()
        assert (evaluation.state, evaluation.attempt) == (State.FAILED, 1)
        assert evaluation.reason == str(fault)
        assert not evaluation.is_platform_fault
        assert "stderr of the policy" in evaluation.operator_detail

    @pytest.fixture
    def ended(self):
        heard = []

        def hear(evaluation, result, now, **kwargs):
            heard.append((evaluation, result))

        evaluation_ended.connect(hear)
        yield heard
        evaluation_ended.disconnect(hear)


class TestQueueing:
    def test_the_specification_is_frozen(self, alice, submit, oval):
        evaluation = submit(alice)
        model = evaluation.model
        assert evaluation.spec == {
            "track": oval.fingerprint,
            "look": "official",
            "rules": RaceRules().to_dict(),
            "metadata": model.metadata,
        }

    def test_a_foreign_or_deleted_model_is_refused(self, alice, bob, oval, wakes, now):
        model = model_row(bob)
        for owner in (alice, bob):
            if owner is bob:
                delete_model(model=model, now=now)
            with pytest.raises(UserFault) as refused:
                queue_evaluation(owner=owner, model=model, track=oval, rules=RaceRules(), now=now)
            assert refused.value.code == "model_not_yours"
        assert not Evaluation.objects.exists()

    def test_the_wake_up_is_sent_on_commit(self, alice, submit, wakes, django_capture_on_commit_callbacks):
        with django_capture_on_commit_callbacks(execute=True):
            submit(alice)
            assert wakes == []
        assert len(wakes) == 1

    def test_a_rolled_back_submission_sends_no_wake_up(self, alice, submit, wakes, django_capture_on_commit_callbacks):
        with (
            django_capture_on_commit_callbacks(execute=True),
            pytest.raises(ZeroDivisionError),
            transaction.atomic(),
        ):
            submit(alice)
            raise ZeroDivisionError
        assert wakes == []

    def test_a_submission_is_accepted_while_the_broker_is_down(
        self, alice, submit, monkeypatch, caplog, django_capture_on_commit_callbacks
    ):
        monkeypatch.undo()  # no pretended broker: the real one's socket does not exist
        with django_capture_on_commit_callbacks(execute=True):
            evaluation = submit(alice)
        assert Evaluation.objects.get() == evaluation
        assert "the sweep wakes workers again" in caplog.text

    def test_the_sweep_sends_a_wake_up_for_waiting_runs(
        self, alice, submit, wakes, now, django_capture_on_commit_callbacks
    ):
        for _ in range(20):
            submit(alice)
        wakes.clear()
        with django_capture_on_commit_callbacks(execute=True):
            report = EVALUATIONS.sweep(now=now)
        assert report.waiting == 20
        assert len(wakes) == 8
        assert all(wake["expires"] == wakeup.STALE_AFTER_S for wake in wakes)

    def test_the_sweep_of_an_empty_queue_sends_nothing(self, db, wakes, now, django_capture_on_commit_callbacks):
        with django_capture_on_commit_callbacks(execute=True):
            assert EVALUATIONS.sweep(now=now) == SweepReport(0, 0)
        assert wakes == []

    def test_a_platform_fault_sends_a_wake_up_for_the_next_attempt(
        self, alice, submit, wakes, now, django_capture_on_commit_callbacks
    ):
        submit(alice)
        evaluation = claim(now)
        wakes.clear()
        with django_capture_on_commit_callbacks(execute=True):
            EVALUATIONS.fail(pk=evaluation.pk, lease=evaluation.lease, fault=PlatformFault("storage_failed"), now=now)
        assert len(wakes) == 1


@pytest.mark.django_db(transaction=True)
def test_simultaneous_claims_get_different_rows(alice, bob, charlie, submit, now):
    for racer in (alice, bob, charlie):
        for _ in range(4):
            submit(racer)
    claimed: list[int] = []
    ready = threading.Barrier(6)

    def claim_all():
        try:
            ready.wait()
            while (evaluation := claim(now)) is not None:
                claimed.append(evaluation.pk)
        finally:
            connections.close_all()

    threads = [threading.Thread(target=claim_all) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(claimed) == sorted(Evaluation.objects.values_list("pk", flat=True))
    assert set(Evaluation.objects.values_list("attempt", "state")) == {(1, State.RUNNING)}
