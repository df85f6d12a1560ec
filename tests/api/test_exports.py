"""Models downloaded for others through the API, and uploaded again."""

from __future__ import annotations

import io
import json
import tarfile

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile

from evaluation.garage.services import share_model
from evaluation.models import TrainedModel
from tests.factories import a_model
from tests.sandbox.networks import METADATA, small_network

pytestmark = pytest.mark.django_db
MODELS = "/api/v1/models/"
FORMS = ("car", "openvino")


def uploaded(client, files: dict[str, bytes]) -> dict:
    answer = client.post(
        MODELS, {key: SimpleUploadedFile(key, content) for key, content in files.items()}, format="multipart"
    )
    assert answer.status_code in (200, 201), answer.data
    return {"status": answer.status_code, **answer.data}


@pytest.fixture
def written(monkeypatch) -> list[tuple[str, int]]:
    """No process writes; the forms and racers that were asked for."""
    asked = []

    def export(onnx, metadata, form, limits, *, racer_pk):
        asked.append((form, racer_pk))
        return b"an archive"

    monkeypatch.setattr("evaluation.garage.downloads.export_in_sandbox", export)
    return asked


def test_the_file_for_a_car_is_the_same_model_when_it_comes_back(alice, bob, as_racer):
    client = as_racer(alice)
    first = uploaded(client, {"model": small_network(), "metadata": json.dumps(METADATA).encode()})
    answer = client.get(f"{MODELS}{first['public_id']}/export/car/")
    assert (answer.status_code, answer["Content-Type"]) == (200, "application/gzip")
    with tarfile.open(fileobj=io.BytesIO(answer.content)) as archive:
        assert archive.getnames() == ["agent/model.pb", "model_metadata.json"]
    again = uploaded(client, {"package": answer.content})
    assert (again["status"], again["public_id"]) == (200, first["public_id"])
    elsewhere = uploaded(as_racer(bob), {"package": answer.content})
    assert (elsewhere["sha256"], elsewhere["source_kind"]) == (first["sha256"], "tensorflow")


@pytest.mark.parametrize("form", FORMS)
def test_whoever_sees_a_model_may_have_it_in_every_form(form, alice, as_racer, bob, written, now):
    model = a_model(alice)
    address = f"{MODELS}{model.public_id}/export/{form}/"
    assert as_racer(alice).get(address).content == b"an archive"
    assert as_racer(bob).get(address).status_code == 404
    share_model(model=model, now=now)
    assert as_racer(bob).get(address).status_code == 200
    assert as_racer(None).get(address).status_code == 401
    assert written == [(form, alice.pk), (form, bob.pk)]


def test_another_form_is_no_address(alice, as_racer, written):
    assert as_racer(alice).get(f"{MODELS}{a_model(alice).public_id}/export/tflite/").status_code == 404


def test_only_its_owner_gets_what_was_uploaded(alice, bob, as_racer, now):
    sent = json.dumps(METADATA).encode()
    made = uploaded(as_racer(alice), {"model": small_network(), "metadata": sent})
    address = f"{MODELS}{made['public_id']}/upload/"
    answer = as_racer(alice).get(address)
    assert answer.status_code == 200 and sent in b"".join(answer.streaming_content)
    share_model(model=TrainedModel.objects.get(public_id=made["public_id"]), now=now)
    assert as_racer(bob).get(address).status_code == 404, "a reward function may be in it"
    assert as_racer(None).get(address).status_code == 401
    missing = as_racer(alice).get(f"{MODELS}{a_model(alice).public_id}/upload/")
    assert (missing.status_code, missing.data["code"]) == (404, "source_not_kept")
