"""Storage goes and comes back, simulators die: what was accepted is run in the end."""

from __future__ import annotations

import contextlib
import zlib
from datetime import timedelta

import botocore.exceptions as s3
import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import FileSystemStorage, default_storage
from django.db import IntegrityError, transaction
from storages.backends.s3 import S3Storage

from core.files.storage_faults import storage_at_work
from core.jobs import outages
from core.jobs import work as turns
from core.jobs.kinds import end_outages
from core.jobs.models import Outage
from core.jobs.retried import pause_after
from evaluation.models import Evaluation, State
from evaluation.running import pipeline
from evaluation.running.queue import worker as work
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from evaluation.sandbox import probe as probing
from paddock.errors import PlatformFault
from paddock.rules.race import RaceRules
from tests.evaluation.stubs import finishes, outcome_of
from tests.rows import model_row

# A bucket's client raises these, and no OSError among them.
STOPPED = s3.EndpointConnectionError(endpoint_url="http://bucket")
SLOW = s3.ReadTimeoutError(endpoint_url="http://bucket")
FULL = s3.ClientError({"Error": {"Code": "XMinioStorageFull"}}, "PutObject")
DAMAGED = zlib.error("incorrect data check")


class Bucket:
    """The tests' storage with a fault that can be switched on: it fails as a bucket's client does, or it lies."""

    def __init__(self, monkeypatch):
        self.fault = self.lies = None
        opened, saved = FileSystemStorage._open, FileSystemStorage._save

        def _open(storage, *args):
            self.perhaps_fail()
            return ContentFile(b"something else") if self.lies else opened(storage, *args)

        def _save(storage, *args):
            self.perhaps_fail()
            return saved(storage, *args)

        monkeypatch.setattr(FileSystemStorage, "_open", _open)
        monkeypatch.setattr(FileSystemStorage, "_save", _save)

    def perhaps_fail(self):
        if self.fault is not None:
            raise self.fault


@pytest.fixture
def bucket(monkeypatch):
    return Bucket(monkeypatch)


@pytest.fixture
def cars(alice, bob, oval, wakes, now):
    """Four accepted cars."""
    for racer in (alice, bob):
        for number in range(2):
            model = model_row(racer, name=f"Car {number}", onnx=f"{racer.alias} {number}".encode())
            queue_evaluation(owner=racer, model=model, track=oval, rules=RaceRules(), now=now)
    return Evaluation.objects.order_by("pk")


@pytest.fixture
def turn(monkeypatch, now):
    """A worker's turn ``after`` seconds, as the pipeline's stub plays it; it sweeps before it looks."""
    monkeypatch.setattr(pipeline, "evaluate", finishes)
    monkeypatch.setattr(EVALUATIONS, "heartbeat", lambda job: contextlib.nullcontext(Steady()))

    def take(after):
        at = now + timedelta(seconds=after)
        for part in (turns, work):
            monkeypatch.setattr(part, "database_now", lambda: at)
        EVALUATIONS.sweep(now=at, wake=False)
        return run_next_evaluation(worker="w")

    return take


class Steady:
    """A heartbeat that needs no thread."""

    lost = False

    def tell(self, progress):
        pass


def states(cars):
    return set(cars.values_list("state", flat=True))


class TestStorageOutage:
    @pytest.mark.parametrize("fault", [STOPPED, SLOW, FULL, OSError(28, "No space left on device"), DAMAGED])
    def test_fifty_seconds_without_storage_fail_no_car(self, cars, turn, bucket, fault):
        bucket.fault = fault
        assert turn(0)
        for second in range(1, 50, 6):
            assert not turn(second), "nobody claims what could only fail"
        assert states(cars) == {State.QUEUED}
        assert sorted(cars.values_list("attempt", flat=True)) == [0, 0, 0, 1], "one car found it out for all"
        bucket.fault = None
        taken = [second for second in range(50, 111) if turn(second)]
        assert states(cars) == {State.FINISHED}
        assert taken[0] <= 50 + 60, "it is looked for at least once a minute"
        assert not Outage.objects.exists()

    def test_a_storage_that_lies_counts_as_out(self, db, bucket):
        assert outages.storage_answers()
        bucket.lies = True
        assert not outages.storage_answers()

    def test_a_day_without_storage_fails_no_car(self, cars, turn, bucket):
        bucket.fault = STOPPED
        for minute in range(0, 24 * 60, 20):
            turn(60 * minute)
        bucket.fault = None
        assert all(turn(86_400 + second) for second in range(4))
        assert states(cars) == {State.FINISHED}

    def test_one_lost_file_keeps_nobody_else_waiting(self, cars, turn):
        lost = cars[0]
        default_storage.delete(lost.model.network.onnx.name)
        taken = [turn(second) for second in range(60)]
        assert taken.count(True) == 3 + 4, "the lost one was tried at once, after 4 and after 16 s"
        lost.refresh_from_db()
        assert (lost.state, lost.attempt) == (State.QUEUED, 4)
        assert set(cars.exclude(pk=lost.pk).values_list("state", flat=True)) == {State.FINISHED}

    def test_pausing_runs_resume_when_storage_is_back(self, cars, turn, bucket, now):
        bucket.fault = STOPPED
        turn(0)
        far = now + timedelta(hours=1)
        Evaluation.objects.filter(attempt=1).update(not_before=far)
        bucket.fault = None
        assert not turn(4)
        assert turn(5)
        assert not cars.filter(not_before__isnull=False).exists()

    def test_one_worker_at_a_time_probes_the_storage(self, cars, turn, bucket, now, monkeypatch):
        bucket.fault = STOPPED
        turn(0)
        looked = []

        def nested():
            looked.append(1)
            end_outages("storage", now=now + timedelta(seconds=6))
            return False

        monkeypatch.setattr(outages, "storage_answers", nested)
        end_outages("storage", now=now + timedelta(seconds=6))
        assert looked == [1]

    def test_a_bucket_with_a_stopped_server_is_a_storage_fault(self):
        from botocore.config import Config

        away = S3Storage(
            bucket_name="b",
            access_key="a",
            secret_key="s",
            endpoint_url="http://127.0.0.1:1",
            client_config=Config(connect_timeout=1, retries={"total_max_attempts": 1}),
        )
        for use in (lambda: away.save("x", ContentFile(b"x")), lambda: away.open("x").read()):
            with pytest.raises(PlatformFault) as caught, storage_at_work():
                use()
            assert caught.value.code == "storage_failed"


class TestSimulatorCrash:
    def test_a_car_is_given_up_while_others_pass(self, cars, now):
        killer = cars[0]
        for kill in range(1, 6):
            self.passes(cars[1], now + timedelta(hours=2 * kill))
            self.kills(killer, now + timedelta(hours=2 * kill + 1))
            killer.refresh_from_db()
            assert killer.kills == kill
        assert (killer.state, killer.reason_code) == (State.FAILED, "platform_gave_up")
        assert killer.is_platform_fault
        assert "5 times" in killer.reason

    def test_a_car_is_retried_while_nobody_passes(self, cars, now):
        for hour in range(20):
            self.kills(cars[0], now + timedelta(hours=2 * hour))
        cars[0].refresh_from_db()
        assert (cars[0].state, cars[0].attempt, cars[0].kills) == (State.QUEUED, 20, 0)

    def test_a_pass_of_its_own_network_does_not_count(self, cars, now, bob, oval):
        twin = model_row(bob, name="Twin", onnx=f"{cars[0].owner.alias} 0".encode())
        other = queue_evaluation(owner=bob, model=twin, track=oval, rules=RaceRules(), now=now)
        self.passes(other, now + timedelta(hours=1))
        self.kills(cars[0], now + timedelta(hours=2))
        assert Evaluation.objects.get(pk=cars[0].pk).kills == 0

    def claimed(self, evaluation, at):
        others = Evaluation.objects.filter(pk=evaluation.pk)
        others.update(state=State.QUEUED, ended_at=None, priority=99)
        claimed = EVALUATIONS.claim(worker="w", now=at)
        assert claimed.pk == evaluation.pk
        others.update(priority=0)
        return {"pk": claimed.pk, "lease": claimed.lease}

    def kills(self, evaluation, at):
        fault = PlatformFault("runner_died", how="signal 11")
        assert EVALUATIONS.fail(**self.claimed(evaluation, at), fault=fault, now=at)

    def passes(self, evaluation, at):
        from evaluation.models import Result

        Result.objects.filter(evaluation=evaluation).delete()
        assert finish_evaluation(**self.claimed(evaluation, at), outcome=outcome_of(), now=at)


def test_pauses_grow_up_to_an_hour():
    assert [pause_after(attempt).total_seconds() for attempt in (1, 2, 3, 4, 5, 6, 7, 8, 500)] == [
        *(0, 4, 16, 64, 256, 1024, 3600, 3600, 3600)
    ]


def test_only_a_queued_run_may_pause(cars, now):
    claimed = EVALUATIONS.claim(worker="w", now=now)
    for changes in ({"not_before": now, "failed_at": now}, {"kills": claimed.attempt + 1}):
        with pytest.raises(IntegrityError), transaction.atomic():
            Evaluation.objects.filter(pk=claimed.pk).update(**changes)
    with pytest.raises(IntegrityError), transaction.atomic():
        cars.filter(state=State.QUEUED).update(not_before=now)  # without a fault


def test_a_worker_that_lost_its_sandbox_probes_again(cars, turn, monkeypatch):
    looks = []
    monkeypatch.setattr(probing, "look_again", lambda: looks.append(1))

    def fails(*args, **kwargs):
        raise PlatformFault("sandbox_failed")

    monkeypatch.setattr(pipeline, "evaluate", fails)
    assert turn(0)
    assert looks == [1]
