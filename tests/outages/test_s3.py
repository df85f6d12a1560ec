"""Files in a real bucket: a server that is stopped, slow, full or lying fails nobody's car, and no page with a 500."""

from __future__ import annotations

import contextlib
import json
from datetime import timedelta

import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from django.utils import timezone

from core.jobs import work as turns
from core.jobs.models import Outage
from evaluation import stored_files as stored
from evaluation.models import Damage, Evaluation, Result, State, StoredFile
from evaluation.running import pipeline
from evaluation.running.queue import worker as work
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from paddock.errors import PlatformFault
from paddock.rules.race import RaceRules
from tests.evaluation.stubs import finishes
from tests.evaluation.test_outages import Steady
from tests.factories import a_race, a_racer, drive, laps
from tests.outages.bucket import MOODS
from tests.pages.test_garage import upload, zipped
from tests.rows import model_row
from tests.sandbox.networks import METADATA, small_network

pytestmark = [pytest.mark.django_db, pytest.mark.slow]
READS = [mood for mood in MOODS if mood != "full"]  # a full one is still read


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


@pytest.fixture
def driven(s3, wakes):
    """Somebody's car that has driven, seen by its owner."""
    now, alice = timezone.now(), a_racer("alice")
    submission = drive(a_race(now, slug="the-race"), alice, laps(10_000, 9_000, 9_500), now)
    model = submission.evaluation.model
    model.network.onnx.delete(save=False)
    model.network.onnx.name = stored.store(f"networks/{model.network.sha256}.onnx", b"a network")
    model.network.save(update_fields=["onnx"])
    return submission


@pytest.fixture
def owner(driven):
    client = Client(raise_request_exception=False)
    client.force_login(driven.entry.racer, backend="django.contrib.auth.backends.ModelBackend")
    return client


@pytest.mark.parametrize("mood", MOODS)
def test_accepted_cars_finish_once_the_bucket_is_back(mood, s3, turn, alice, oval, wakes, now):
    for number in range(3):
        model = model_row(alice, name=f"Car {number}", onnx=f"network {number}".encode())
        model.network.onnx.delete(save=False)
        model.network.onnx.name = stored.store(f"networks/{number}.onnx", f"network {number}".encode())
        model.network.save(update_fields=["onnx"])
        queue_evaluation(owner=alice, model=model, track=oval, rules=RaceRules(), now=now)
    s3.be(mood)
    taken = [turn(second) for second in range(0, 4)]
    assert taken.count(True) <= 3 and not Result.objects.exists()
    assert set(Evaluation.objects.values_list("state", flat=True)) == {State.QUEUED}
    assert Outage.objects.exists()
    detail = Evaluation.objects.exclude(operator_detail="").get().operator_detail
    assert "storage_failed" in detail or "file_damaged" in detail
    s3.be("")
    for second in range(60, 160, 5):
        turn(second)
    assert set(Evaluation.objects.values_list("state", flat=True)) == {State.FINISHED}
    assert not Outage.objects.exists()


@pytest.mark.parametrize("mood", READS)
def test_an_unavailable_file_is_a_503_that_blames_the_platform(mood, s3, driven, owner):
    run, model = driven.evaluation.public_id, driven.evaluation.model.public_id
    pages = [f"/evaluations/{run}/trace.csv", f"/evaluations/{run}/replay.json", f"/models/{model}/package.zip"]
    api = [f"/api/v1/evaluations/{run}/trace/", f"/api/v1/evaluations/{run}/logs/", f"/api/v1/models/{model}/package/"]
    assert {owner.get(address).status_code for address in pages + api} == {200}
    s3.be(mood)
    for address in pages:
        answer = owner.get(address)
        assert answer.status_code == 503 and answer["Retry-After"], address
        assert "Your model is fine" in answer.content.decode(), address
    for address in api:
        answer = owner.get(address)
        assert answer.status_code == 503 and answer.json()["fault"] == "platform", address
        assert answer.json()["code"] in ("storage_failed", "file_damaged")
    for address in ("/", "/races/the-race/", f"/evaluations/{run}/", "/models/", f"/models/{model}/"):
        assert owner.get(address).status_code == 200, address


@pytest.mark.parametrize("mood", ["stopped", "slow", "full"])
def test_an_upload_that_cannot_be_stored_is_a_503(mood, s3, driven, owner):
    package = zipped(bolt__onnx=small_network(), model_metadata__json=json.dumps(METADATA).encode())
    known = StoredFile.objects.count()
    s3.be(mood)
    page = upload(owner, SimpleUploadedFile("car.zip", package))
    assert page.status_code == 503 and "Your model is fine" in page.content.decode()
    asked = owner.post("/api/v1/models/", {"package": SimpleUploadedFile("car.zip", package)})
    assert (asked.status_code, asked.json()["code"]) == (503, "storage_failed")
    assert StoredFile.objects.count() == known and driven.entry.racer.models.count() == 1


class TestScrub:
    def test_it_finds_altered_and_lost_files_in_a_bucket(self, s3, driven, now):
        altered, lost = driven.evaluation.result.trace.name, driven.evaluation.model.network.onnx.name
        default_storage.delete(altered)
        default_storage.save(altered, ContentFile(b"something else"))
        default_storage.delete(lost)
        assert stored.scrub(now=now)["damaged"] == 2
        assert dict(StoredFile.objects.exclude(damage="").values_list("name", "damage")) == {
            altered: Damage.ALTERED,
            lost: Damage.MISSING,
        }

    @pytest.mark.parametrize("mood", ["stopped", "slow", "short"])
    def test_a_server_outage_is_not_reported_as_damage(self, mood, s3, driven, now):
        s3.be(mood)
        with pytest.raises(PlatformFault) as raised:
            stored.scrub(now=now)
        assert raised.value.code == "storage_failed"
        assert not StoredFile.objects.exclude(damage="").exists()
