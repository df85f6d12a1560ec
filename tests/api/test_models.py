"""The garage through the API."""

from __future__ import annotations

import gc
import io
import json
import zipfile

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile

from evaluation.garage.admission import AdmittedPackage
from evaluation.models import TrainedModel
from tests.factories import a_model
from tests.hostile.parts import outside, small_car, training_folder
from tests.sandbox.networks import METADATA, constant_network, small_network
from tests.shared import CONSOLE_CAR, needs_shared

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/models/"


def onnx_file(data: bytes | None = None) -> SimpleUploadedFile:
    return SimpleUploadedFile("bolt.onnx", small_network() if data is None else data)


def metadata_file(data: bytes | None = None) -> SimpleUploadedFile:
    return SimpleUploadedFile("model_metadata.json", json.dumps(METADATA).encode() if data is None else data)


def upload(client, **sent):
    return client.post(ADDRESS, sent, format="multipart")


def test_a_model_uploaded_twice_is_recognised(alice, as_racer):
    client = as_racer(alice)
    first = upload(client, model=onnx_file(), metadata=metadata_file(), name="Bolt", description="Straight on.")
    assert first.status_code == 201, first.data
    assert (first.data["name"], first.data["description"]) == ("Bolt", "Straight on.")
    assert first.data["source_kind"] == "onnx"
    assert first.data["sensors"] == ["FRONT_FACING_CAMERA"]
    assert first.data["metadata"]["action_space"][0]["steering_angle"] == -20.0
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("bolt.onnx", small_network())
        archive.writestr("model_metadata.json", json.dumps(METADATA))
    again = upload(client, package=SimpleUploadedFile("another name.zip", packed.getvalue()))
    assert again.status_code == 200
    assert (again.data["public_id"], again.data["sha256"]) == (first.data["public_id"], first.data["sha256"])
    told = {"upload": {"network": "", "checkpoint": "", "output": "", "ignored": []}}
    assert {**client.get(f"{ADDRESS}{first.data['public_id']}/").data, **told} == first.data
    assert again.data["upload"]["network"] == "bolt.onnx"


@needs_shared
def test_a_console_model_can_be_uploaded_as_it_is(alice, as_racer):
    with CONSOLE_CAR.open("rb") as file:
        answer = upload(as_racer(alice), package=file)
    assert answer.status_code == 201, answer.data
    assert answer.data["source_kind"] == "tensorflow"
    assert answer.data["name"] == "deepracer-console-15"


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        ({"package": lambda: SimpleUploadedFile("car.tar.gz", b"")}, "empty"),
        ({"package": lambda: SimpleUploadedFile("car.tar.gz", b"MZ" + bytes(600))}, "not_a_model"),
        ({"model": onnx_file}, "metadata_missing"),
        ({"metadata": metadata_file}, "model_missing"),
        ({"model": onnx_file, "metadata": lambda: metadata_file(b"{")}, "metadata_not_json"),
        ({"package": onnx_file, "model": onnx_file}, "upload_parts"),
        ({}, "empty"),
        ({"model": onnx_file, "metadata": metadata_file, "name": "  "}, "model_name_missing"),
        ({"model": onnx_file, "metadata": metadata_file, "name": "x" * 65}, "model_name_too_long"),
        ({"model": onnx_file, "metadata": metadata_file, "description": "x" * 256}, "description_too_long"),
    ],
)
def test_a_refused_upload_says_why_and_stores_nothing(alice, as_racer, sent, code):
    sent = {name: part() if callable(part) else part for name, part in sent.items()}
    answer = upload(as_racer(alice), **sent)
    assert (answer.status_code, answer.data["code"], answer.data["fault"]) == (400, code, "user")
    assert len(answer.data["message"]) > 20
    assert "%(" not in answer.data["message"]
    assert not TrainedModel.objects.exists()


def test_a_network_that_outputs_nan_is_refused_on_upload(alice, as_racer):
    nan = constant_network((float("nan"), 0.0, 0.0))
    answer = upload(as_racer(alice), model=onnx_file(nan), metadata=metadata_file())
    assert answer.status_code == 400
    assert answer.data["code"] in ("non_finite_weights", "network_non_finite")


def test_a_value_that_is_not_a_file_is_named_by_its_field(alice, as_racer):
    answer = upload(as_racer(alice), package="not a file")
    assert (answer.status_code, answer.data["code"]) == (400, "invalid")
    assert set(answer.data["fields"]) == {"package"}


def test_a_full_garage_refuses_an_upload_unread(alice, as_racer, settings):
    settings.MODELS_PER_RACER = 1
    a_model(alice)
    answer = upload(as_racer(alice), model=onnx_file(), metadata=metadata_file())
    assert (answer.status_code, answer.data["code"], answer.data["params"]) == (409, "garage_full", {"limit": 1})


def test_uploads_are_limited_per_racer(alice, bob, as_racer, monkeypatch):
    from rest_framework.throttling import ScopedRateThrottle

    monkeypatch.setattr(ScopedRateThrottle, "THROTTLE_RATES", {"upload": "9/hour", "refused_upload": "2/hour"})
    client = as_racer(alice)
    assert [upload(client).status_code for _ in range(3)] == [400, 400, 429]
    assert client.get(ADDRESS).status_code == 200, "reading is not limited"
    assert upload(as_racer(bob)).status_code == 400, "others are not affected"


def test_the_garage_is_paginated_newest_first(alice, bob, as_racer, django_assert_max_num_queries):
    mine = [a_model(alice) for _ in range(5)]
    a_model(bob)
    client = as_racer(alice)
    with django_assert_max_num_queries(4):
        first = client.get(ADDRESS, {"page_size": 2})
    assert (first.data["count"], first.data["page"], first.data["pages"]) == (5, 1, 3)
    assert first.data["previous"] is None
    names = [row["name"] for row in first.data["results"]]
    address = first.data["next"]
    while address:
        page = client.get(address)
        names += [row["name"] for row in page.data["results"]]
        address = page.data["next"]
    assert names == [model.name for model in reversed(mine)]
    assert client.get(ADDRESS, {"page": 9}).status_code == 404
    assert len(client.get(ADDRESS, {"page_size": 100}).data["results"]) == 5


def test_name_and_description_can_be_changed_separately(alice, as_racer):
    model = a_model(alice)
    client, address = as_racer(alice), f"{ADDRESS}{model.public_id}/"
    assert client.patch(address, {"description": "Faster."}).data["name"] == model.name
    answer = client.patch(address, {"name": "Thunder"})
    assert (answer.data["name"], answer.data["description"]) == ("Thunder", "Faster.")
    other = a_model(alice)
    taken = client.patch(address, {"name": other.name})
    assert (taken.status_code, taken.data["code"]) == (409, "model_name_taken")


def test_a_deleted_model_is_not_found(alice, as_racer):
    model = a_model(alice)
    client, address = as_racer(alice), f"{ADDRESS}{model.public_id}/"
    assert client.delete(address).status_code == 204
    assert client.get(address).status_code == 404
    assert client.get(ADDRESS).data["count"] == 0
    assert client.delete(address).status_code == 404


@pytest.mark.parametrize("method", ["get", "patch", "delete"])
def test_only_its_owner_may_use_a_model(alice, cast, method):
    address = f"{ADDRESS}{a_model(alice).public_id}/"
    for role in ("member", "stranger", "admin"):
        assert getattr(cast[role], method)(address).status_code == 404, role
    assert getattr(cast["anonymous"], method)(address).status_code == 401
    assert getattr(cast["owner"], method)(address).status_code in (200, 204)


def test_an_upload_reports_what_was_used_of_it(alice, as_racer):
    [(name, folder)] = training_folder({4: small_car()}, b'{"best_checkpoint": {"name": "4_Step-90.ckpt"}}')
    file = SimpleUploadedFile(name, folder)
    answer = as_racer(alice).post("/api/v1/models/", {"package": file, "checkpoint": "last"}, format="multipart")
    assert answer.status_code == 201, answer.data
    told = answer.data["upload"]
    assert (told["network"], told["checkpoint"], told["output"]) == ("model/model_4.pb", "asked", "")
    assert "checksum.txt" in told["ignored"]


def test_an_answered_upload_holds_no_network(alice, as_racer):
    """DRF's serializers are cycles, which Python collects late: some uploads of 20 MB each would wait for that."""
    gc.collect()
    gc.disable()
    try:
        assert upload(as_racer(alice), model=onnx_file(), metadata=metadata_file()).status_code == 201
        held = [each for each in gc.get_objects() if type(each) is AdmittedPackage]
        assert held
        assert not [each for each in held if each.onnx]
    finally:
        gc.enable()


def test_weights_beside_an_onnx_file_are_uploaded_separately(alice, as_racer):
    (_, network), (_, data), (_, metadata) = outside({"location": "car.onnx.data"}, bytes(20))
    files = {
        "model": SimpleUploadedFile("car.onnx", network),
        "metadata": SimpleUploadedFile("m.json", metadata),
        "weights": SimpleUploadedFile("car.onnx.data", data),
    }
    assert as_racer(alice).post("/api/v1/models/", files, format="multipart").status_code == 201
    without = {key: SimpleUploadedFile(key, file) for key, file in (("model", network), ("metadata", metadata))}
    refused = as_racer(alice).post("/api/v1/models/", without, format="multipart")
    assert (refused.status_code, refused.data["code"]) == (400, "onnx_external_missing")
    assert "car.onnx.data" in refused.data["message"]
