"""A new format of uploads is one entry of a list: reading, rows, pages, forms, the API and the command have it."""

from __future__ import annotations

from typing import Any

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from drf_spectacular.generators import SchemaGenerator
from rest_framework.test import APIClient

from evaluation.garage.forms import UploadForm
from evaluation.models import TrainedModel
from paddock.cli.folders import models_in
from paddock.errors import PlatformFault, UserFault
from paddock.packages.kinds import FORMATS, UploadFormat
from paddock.packages.own import read_car
from tests.docs.pages import code_blocks, section, text
from tests.evaluation.test_admit import upload
from tests.factories import a_model, a_racer
from tests.hostile.parts import Upload, archive, good_network, metadata, pair

pytestmark = pytest.mark.django_db
# The format that the page of common changes shows
(BLOCK,) = code_blocks(section(text("changes.md"), "## An upload format"), "python")
SHOWN: dict[str, Any] = {}
exec(compile(BLOCK, "changes.md", "exec"), SHOWN)
MAGIC, PLAIN = SHOWN["MAGIC"], SHOWN["PLAIN"]


@pytest.fixture(autouse=True)
def plain(monkeypatch, admitted_here):
    monkeypatch.setitem(FORMATS, "plain", PLAIN)


def network() -> bytes:
    return MAGIC + good_network()


def loose() -> Upload:
    return [("car.plain", network()), ("model_metadata.json", metadata())]


def packed() -> Upload:
    return archive(("some/car.plain", network()), ("model_metadata.json", metadata()))


@pytest.mark.parametrize("files", [loose(), packed()], ids=["two files", "archive"])
def test_an_upload_of_it_is_the_same_model_as_its_onnx(files):
    admitted = upload(files)
    assert admitted.source_kind == "plain"
    assert admitted.sha256 == upload(pair(good_network())).sha256


def test_the_garage_keeps_and_names_it(settings):
    alice = a_racer("alice")
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    page = client.get("/models/upload/").content.decode()
    assert ".onnx,.pb,.plain" in page
    files = [SimpleUploadedFile(name, content) for name, content in loose()]
    assert client.post("/models/upload/", {"files": files, "name": "Plain"}).status_code == 302
    model = TrainedModel.objects.get()
    assert model.source_kind == "plain"
    assert "<dt>Uploaded as</dt><dd>Plain network</dd>" in client.get(model.get_absolute_url()).content.decode()
    api = APIClient()
    api.force_authenticate(alice)
    assert api.get(f"/api/v1/models/{model.public_id}/").data["source_kind"] == "plain"


def test_the_schema_names_it():
    schema = SchemaGenerator().get_schema(request=None, public=True)["components"]["schemas"]
    enums = [one["enum"] for one in schema.values() if "tensorflow" in one.get("enum", ())]
    assert enums == [["onnx", "tensorflow", "sb3", "plain"]]


def test_the_form_takes_its_suffix():
    assert UploadForm().fields["files"].widget.attrs["accept"].endswith(",.onnx,.pb,.plain")


def test_the_command_finds_and_reads_it(tmp_path):
    for name, content in loose():
        (tmp_path / name).write_bytes(content)
    (found,), _links = models_in(tmp_path)
    assert found.name == tmp_path.name
    assert read_car([tmp_path / "car.plain", tmp_path / "model_metadata.json"]).sha256 == upload(loose()).sha256


def test_a_format_that_only_some_sites_read_has_a_code_for_the_others(monkeypatch, tmp_path):
    only_there = UploadFormat(
        "plain", "Plain", begins=PLAIN.begins, no_process="sb3_needs_torch", at_home="sb3_at_home"
    )
    monkeypatch.setitem(FORMATS, "plain", only_there)
    with pytest.raises(PlatformFault, match="PyTorch"):
        upload(loose())
    for name, content in loose():
        (tmp_path / name).write_bytes(content)
    with pytest.raises(UserFault) as fault:
        read_car([tmp_path / "car.plain", tmp_path / "model_metadata.json"])
    assert fault.value.code == "sb3_at_home"


def test_a_format_that_the_site_no_longer_knows_is_shown_by_its_own_name(alice):
    model = a_model(alice)
    TrainedModel.objects.update(source_kind="forgotten")
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    html = client.get(model.get_absolute_url()).content.decode()
    assert "<dt>Uploaded as</dt><dd>forgotten</dd>" in html
    api = APIClient()
    api.force_authenticate(alice)
    assert api.get(f"/api/v1/models/{model.public_id}/").data["source_kind"] == "forgotten"


@pytest.mark.parametrize(
    ("kind", "label"), [("onnx", "ONNX"), ("tensorflow", "TensorFlow"), ("sb3", "stable-baselines3")]
)
def test_the_page_names_each_format(alice, kind, label):
    model = a_model(alice)
    TrainedModel.objects.update(source_kind=kind)
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert f"<dd>{label}</dd>" in client.get(model.get_absolute_url()).content.decode()
