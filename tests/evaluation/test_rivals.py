"""Several submitted cars in one evaluation, in the queue and in the database."""

from __future__ import annotations

import os
import uuid
from datetime import timedelta

import pytest
from django.core.files.storage import default_storage
from django.db import IntegrityError, transaction
from django.db.models import ProtectedError

from evaluation.garage.services import delete_model, purge_garages
from evaluation.models import Evaluation, EvaluationRival, Result, RivalResult, State
from evaluation.running.queue import jobs, selectors
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from evaluation.running.queue.services import queue_evaluation, stop_evaluation
from evaluation.running.queue.worker import job_of
from evaluation.running.results import file_names, read_layout, read_trace, store_files
from evaluation.signals import evaluation_ended
from paddock.errors import PlatformFault, UserFault
from paddock.rules.race import BoxPlace, RaceRules
from tests.evaluation.stubs import car_outcome, outcome_of, trace_csv
from tests.rows import METADATA, model_row

DUEL = RaceRules(race_type="head_to_head")
BOX = {"fraction": 0.5, "lane": "inner", "x": 1.0, "y": 2.0, "yaw": 0.25}


@pytest.fixture
def duel(alice, bob, oval, wakes, now):
    """Alice's car and Bob's, waiting."""
    return queue_evaluation(
        owner=alice,
        model=model_row(alice, onnx=b"a"),
        rivals=[model_row(bob, onnx=b"b")],
        track=oval,
        rules=DUEL,
        now=now,
    )


@pytest.fixture
def claimed(duel, now):
    return EVALUATIONS.claim(worker="w", now=now)


def finish(evaluation, now, **outcome):
    outcome.setdefault("rivals", [car_outcome(salt=7)])
    return finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=outcome_of(**outcome), now=now)


def stored(evaluation):
    folder = default_storage.listdir("traces")[1] if default_storage.exists("traces") else []
    return sorted(f"traces/{name}" for name in folder if name.startswith(evaluation.public_id))


class TestQueueing:
    def test_cars_are_frozen_in_their_order(self, alice, bob, charlie, oval, wakes, now):
        rivals = [model_row(racer, onnx=racer.alias.encode()) for racer in (charlie, bob)]
        evaluation = queue_evaluation(
            owner=alice, model=model_row(alice, onnx=b"a"), rivals=rivals, track=oval, rules=DUEL, now=now
        )
        rows = evaluation.rivals.all()
        assert [(row.number, row.model, row.metadata) for row in rows] == [
            (1, rivals[0], METADATA),
            (2, rivals[1], METADATA),
        ]
        rivals[0].metadata = {"sensor": []}
        rivals[0].save()
        assert evaluation.rivals.get(number=1).metadata == METADATA

    def test_a_job_holds_the_networks_of_all_cars(self, claimed):
        job = job_of(claimed)
        assert job.onnx == b"a"
        assert [(rival.onnx, rival.metadata) for rival in job.rivals] == [(b"b", METADATA)]

    def test_a_rivals_missing_file_is_our_fault(self, claimed):
        network = claimed.rivals.get().model.network
        default_storage.delete(network.onnx.name)
        with pytest.raises(PlatformFault) as caught:
            job_of(claimed)
        assert caught.value.code == "file_damaged"

    @pytest.mark.parametrize(
        ("rules", "count", "code"),
        [
            (RaceRules(), 1, "rivals_race_type"),
            (RaceRules(race_type="object_avoidance", boxes=(BoxPlace(0.5, "inner"),)), 1, "rivals_race_type"),
            (RaceRules(race_type="head_to_head", bots=1), 1, "rivals_with_bots"),
            (DUEL, 4, "too_many_rivals"),
        ],
    )
    def test_unsuitable_rivals_are_refused(self, alice, bob, oval, wakes, now, rules, count, code):
        with pytest.raises(UserFault) as caught:
            queue_evaluation(
                owner=alice,
                model=model_row(alice),
                rivals=[model_row(bob)] * count,
                track=oval,
                rules=rules,
                now=now,
            )
        assert caught.value.code == code
        assert not Evaluation.objects.exists()

    def test_a_deleted_model_still_races_others_but_not_alone(self, alice, bob, oval, wakes, now):
        mine, other = model_row(alice, onnx=b"a"), model_row(bob, onnx=b"b")
        for model in (mine, other):
            delete_model(model=model, now=now)
        queue = {"owner": alice, "model": mine, "track": oval, "rules": DUEL, "now": now}
        assert queue_evaluation(**queue, rivals=[other]).rivals.count() == 1
        with pytest.raises(UserFault):
            queue_evaluation(**queue)
        with pytest.raises(UserFault):
            queue_evaluation(**{**queue, "model": other}, rivals=[mine])

    def test_duels_and_runs_of_one_racer_share_turns(self, alice, bob, oval, wakes, now):
        cars = {racer: model_row(racer, onnx=racer.alias.encode()) for racer in (alice, bob)}
        for second in range(2):
            queue_evaluation(
                owner=alice,
                model=cars[alice],
                rivals=[cars[bob]],
                track=oval,
                rules=DUEL,
                now=now + timedelta(seconds=second),
            )
        queue_evaluation(owner=bob, model=cars[bob], track=oval, rules=RaceRules(), now=now + timedelta(seconds=5))
        order = []
        while (evaluation := EVALUATIONS.claim(worker="w", now=now + timedelta(seconds=10))) is not None:
            order.append(evaluation.owner.alias)
        assert order == ["alice", "bob", "alice"]  # to be a rival takes nobody's turn

    def test_only_an_admin_stops_a_duel_of_several_racers(self, alice, bob, duel):
        assert not selectors.can_stop_evaluation(alice, duel)
        assert not selectors.can_stop_evaluation(bob, duel)
        alice.is_staff = True
        assert selectors.can_stop_evaluation(alice, duel)

    def test_a_racer_stops_a_run_of_their_own_cars_only(self, alice, oval, wakes, now):
        cars = [model_row(alice, name=name, onnx=name.encode()) for name in ("Bolt", "Nut")]
        evaluation = queue_evaluation(owner=alice, model=cars[0], rivals=cars[1:], track=oval, rules=DUEL, now=now)
        assert selectors.can_stop_evaluation(alice, evaluation)


class TestConstraints:
    @pytest.mark.parametrize("number", [0, 4])
    def test_a_rivals_number_is_one_to_three(self, duel, number):
        with pytest.raises(IntegrityError), transaction.atomic():
            EvaluationRival.objects.update(number=number)

    def test_a_rivals_number_is_unique(self, duel):
        rival = duel.rivals.get()
        with pytest.raises(IntegrityError), transaction.atomic():
            EvaluationRival.objects.create(evaluation=duel, number=1, model=rival.model, metadata=METADATA)

    def test_a_rival_has_metadata(self, duel):
        with pytest.raises(IntegrityError), transaction.atomic():
            EvaluationRival.objects.update(metadata={})

    def test_a_first_car_with_laps_has_a_best_lap(self, claimed, now):
        assert finish(claimed, now)
        with pytest.raises(IntegrityError), transaction.atomic():
            Result.objects.update(best_lap_ms=None)

    @pytest.mark.parametrize(
        "change",
        [
            {"number": 0},
            {"number": 4},
            {"trace_sha256": "A" * 64},
            {"complete_laps": 0},
            {"best_lap_ms": None},
            {"end_reason": "retired"},
            {"retired_code": "policy_died"},
        ],
        ids=str,
    )
    def test_a_rivals_contradictory_result_is_refused(self, claimed, now, change):
        assert finish(claimed, now)
        with pytest.raises(IntegrityError), transaction.atomic():
            RivalResult.objects.update(**change)

    def test_a_rival_has_only_one_result(self, claimed, now):
        assert finish(claimed, now)
        row = RivalResult.objects.get()
        row.pk = None
        with pytest.raises(IntegrityError), transaction.atomic():
            row.save(force_insert=True)

    def test_a_retired_car_has_a_reason(self, claimed, now):
        assert finish(claimed, now)
        with pytest.raises(IntegrityError), transaction.atomic():
            Result.objects.update(end_reason="retired")

    def test_a_model_that_was_a_rival_cannot_be_removed(self, duel):
        with pytest.raises(ProtectedError):
            duel.rivals.get().model.delete()

    def test_a_deleted_rival_survives_the_purge(self, duel, now):
        model = duel.rivals.get().model
        delete_model(model=model, now=now)
        purge_garages(now=now + timedelta(days=30))
        model.refresh_from_db()
        assert default_storage.exists(model.network.onnx.name)


class TestResult:
    def test_every_car_has_laps_trajectory_and_trace(self, claimed, now):
        rival = car_outcome(salt=7, laps=(9_000, 8_000, 3_000), unfinished=True)
        assert finish(claimed, now, rivals=[rival], order=[1, 0])
        result = Result.objects.get()
        (row,) = result.rivals.all()
        assert result.order == [1, 0]
        assert (row.number, row.complete_laps, row.best_lap_ms, row.total_ms) == (1, 2, 8_000, 20_000)
        assert (row.off_tracks, row.crashes, row.resets) == (3, 0, 3)
        assert row.end_reason == "time_up" and row.retired == ""
        assert len(row.trajectory) == 3
        assert read_trace(row) == rival.trace_csv
        assert read_trace(result) == trace_csv(2)
        assert row.trace_sha256 == rival.trace_sha256
        assert stored(claimed) == sorted([result.trace.name, row.trace.name])

    def test_a_retired_car_says_why(self, claimed, now):
        assert finish(claimed, now, rivals=[car_outcome(retired="policy_died")])
        (row,) = RivalResult.objects.all()
        assert row.end_reason == "retired"
        assert "step 50 (SIGSEGV)" in row.retired

    def test_the_first_car_may_retire_too(self, claimed, now):
        retired = {"code": "non_finite_action", "params": {"step": 3}}
        assert finish(claimed, now, end_reason="retired", retired=retired)
        assert "in step 3" in Result.objects.get().retired

    def test_a_car_alone_has_won(self, alice, oval, wakes, now):
        queue_evaluation(owner=alice, model=model_row(alice), track=oval, rules=RaceRules(), now=now)
        evaluation = EVALUATIONS.claim(worker="w", now=now)
        assert finish(evaluation, now, rivals=[])
        result = Result.objects.get()
        assert (result.order, result.retired, result.bots.name) == ([0], "", "")
        assert read_layout(result) == {"boxes": [], "bots": []}
        assert stored(evaluation) == [result.trace.name]

    def test_boxes_are_kept_in_the_row_and_bots_in_a_file(self, claimed, now):
        poses = [[[round(0.1 * row, 3), 0.5 * bot, 0.0] for row in range(2000)] for bot in range(4)]
        assert finish(claimed, now, rivals=[], layout={"boxes": [BOX], "bots": poses})
        result = Result.objects.get()
        assert result.layout == {"boxes": [BOX]}
        assert read_layout(result) == {"boxes": [BOX], "bots": poses}
        assert stored(claimed) == sorted([result.trace.name, result.bots.name])

    def test_an_unwritten_result_leaves_no_files(self, claimed, now):
        def refuse(**kwargs):
            raise RuntimeError("a receiver failed")

        evaluation_ended.connect(refuse)
        try:
            with pytest.raises(RuntimeError):
                finish(claimed, now, layout={"boxes": [], "bots": [[[0.0, 0.0, 0.0]]]})
        finally:
            evaluation_ended.disconnect(refuse)
        assert stored(claimed) == []
        assert not Result.objects.exists() and not RivalResult.objects.exists()

    def test_a_signals_receiver_sees_the_rivals_results(self, claimed, now):
        seen = []

        def look(result, **kwargs):
            seen.extend(result.rivals.values_list("number", "best_lap_ms"))

        evaluation_ended.connect(look)
        try:
            assert finish(claimed, now)
        finally:
            evaluation_ended.disconnect(look)
        assert seen == [(1, 9_500)]

    def test_a_storage_failure_half_way_leaves_nothing(self, claimed, now, monkeypatch):
        storage = Result._meta.get_field("trace").storage
        save, calls = storage.save, []

        def full(name, content):
            calls.append(name)
            if len(calls) == 2:
                raise OSError(28, "No space left on device")
            return save(name, content)

        monkeypatch.setattr(storage, "save", full)
        with pytest.raises(PlatformFault) as caught:
            finish(claimed, now)
        assert caught.value.code == "storage_failed"
        assert len(calls) == 2 and stored(claimed) == []

    def test_files_of_a_dead_worker_are_swept_away(self, claimed, now):
        layout = {"boxes": [], "bots": [[[0.0, 0.0, 0.0]]]}
        store_files(claimed, outcome_of(rivals=[car_outcome(), car_outcome(), car_outcome()], layout=layout))
        assert stored(claimed) == sorted(file_names(claimed))
        assert EVALUATIONS.sweep(now=now + timedelta(seconds=100)).requeued == 1
        assert stored(claimed) == []

    def test_a_late_worker_deletes_only_its_own_files(self, claimed, now):
        EVALUATIONS.sweep(now=now + timedelta(seconds=100))
        fast = EVALUATIONS.claim(worker="x", now=now + timedelta(seconds=101))
        assert finish(fast, now)
        assert not finish(claimed, now)
        assert stored(fast) == sorted(file_names(fast)[:2])

    def test_a_commit_without_an_answer_keeps_the_files(self, claimed, now):
        assert finish(claimed, now, layout={"boxes": [], "bots": [[[0.0, 0.0, 0.0]]]})
        before = stored(claimed)
        jobs.delete_files(file_names(claimed))
        assert stored(claimed) == before and len(before) == 3

    def test_a_stopped_duel_has_no_result(self, claimed, now):
        assert stop_evaluation(evaluation=Evaluation.objects.get(), now=now)
        assert not finish(claimed, now)
        assert Evaluation.objects.get().state == State.STOPPED
        assert not RivalResult.objects.exists() and stored(claimed) == []


def test_each_attempt_names_its_files_differently(claimed):
    other = Evaluation(public_id=claimed.public_id, attempt=claimed.attempt, lease=uuid.uuid4())
    assert not set(file_names(claimed)) & set(file_names(other))
    assert len({os.path.basename(name) for name in file_names(claimed)}) == 5
