"""What a model was uploaded as: kept, weighed, given back to the byte, and gone with its model."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from datetime import timedelta

import pytest
from django.core.files.storage import default_storage

from accounts.usage.storage import stored_by
from config.operations.backup.files import file_columns
from evaluation.garage import services as garage
from evaluation.garage.admission import AdmittedPackage
from evaluation.garage.downloads import upload_of
from evaluation.garage.services import delete_model, purge_garages, upload_model
from evaluation.models import StoredFile, TrainedModel
from paddock.errors import PlatformFault, UserFault
from paddock.network.bound import NetworkFacts
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import UploadPart
from tests.rows import METADATA, model_row

pytestmark = pytest.mark.django_db
ARCHIVE = bytes(range(256)) * 5000


@pytest.fixture(autouse=True)
def own_files(settings, tmp_path):
    """Files of this test alone."""
    settings.STORAGES = {
        **settings.STORAGES,
        "default": {"BACKEND": "django.core.files.storage.FileSystemStorage", "OPTIONS": {"location": tmp_path}},
    }


@pytest.fixture(autouse=True)
def admitted(monkeypatch):
    """Admit every upload as a network made of its first file's first bytes."""

    def admit(files, limits, *, racer_pk, checkpoint):
        content = files[0].stream.read()
        onnx = b"onnx of " + content[:8]
        return AdmittedPackage(
            onnx=onnx,
            sha256=hashlib.sha256(onnx).hexdigest(),
            metadata=parse_metadata(json.dumps(METADATA).encode()),
            source_kind="tensorflow",
            source_sha256=hashlib.sha256(content).hexdigest(),
            parameters=7,
            macs=9,
            facts=NetworkFacts(bound=1e-6),
        )

    monkeypatch.setattr(garage, "admit", admit)


def upload(owner, now, *contents: bytes, names=("My car (1).tar.gz", "model_metadata.json"), keep=True):
    files = [
        UploadPart(name, io.BytesIO(content)) for name, content in zip(names, contents or (ARCHIVE,), strict=False)
    ]
    return upload_model(owner=owner, files=files, keep_upload=keep, now=now).model


def kept() -> list[str]:
    return default_storage.listdir("uploads")[1] if default_storage.exists("uploads") else []


def content_of(model) -> bytes:
    return b"".join(upload_of(model).streaming_content)


def test_an_upload_is_given_back_to_the_byte(alice, now):
    model = upload(alice, now)
    answer = upload_of(model)
    assert b"".join(answer.streaming_content) == ARCHIVE
    assert answer["Content-Disposition"] == 'attachment; filename="My-car-1-.tar.gz"'
    assert answer["Content-Type"] == "application/octet-stream"


def test_several_files_come_back_as_one_zip(alice, now):
    model = upload(alice, now, ARCHIVE, b"{}", names=("../a/car.onnx", "model_metadata.json"))
    with zipfile.ZipFile(io.BytesIO(content_of(model))) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == {
            "car.onnx": ARCHIVE,
            "model_metadata.json": b"{}",
        }


def test_two_files_of_one_name_are_both_kept(alice, now):
    model = upload(alice, now, b"one", b"two", names=("x", "x"))
    with zipfile.ZipFile(io.BytesIO(content_of(model))) as archive:
        assert sorted(archive.read(name) for name in archive.namelist()) == [b"one", b"two"]


def test_it_is_weighed_with_what_the_racer_stores(alice, now):
    upload(alice, now)
    (shelf,) = [one for one in stored_by(alice) if one.shelf.name == "uploads"]
    assert shelf.mb == pytest.approx(len(ARCHIVE) / 2**20)


def test_it_goes_when_its_model_is_deleted(alice, now, django_capture_on_commit_callbacks):
    model = upload(alice, now)
    with django_capture_on_commit_callbacks(execute=True):
        delete_model(model=model, now=now)
    assert kept() == []
    assert not StoredFile.objects.filter(name__startswith="uploads/").exists()
    assert not [one for one in stored_by(alice) if one.shelf.name == "uploads"]


def test_it_goes_when_its_row_or_its_racer_does(alice, now, django_capture_on_commit_callbacks):
    upload(alice, now)
    with django_capture_on_commit_callbacks(execute=True):
        alice.delete()
    assert kept() == []


def test_a_model_from_before_has_none_until_the_same_file_comes_again(alice, now):
    model = upload(alice, now, keep=False)
    with pytest.raises(UserFault) as fault:
        upload_of(model)
    assert fault.value.code == "source_not_kept"
    assert upload(alice, now) == model
    model.refresh_from_db()
    assert content_of(model) == ARCHIVE
    upload(alice, now)
    assert len(kept()) == 1, "once is enough"


def test_another_packing_of_a_known_network_is_not_taken_for_its_upload(alice, now):
    model = upload(alice, now, keep=False)
    assert upload(alice, now, ARCHIVE + b"more") == model
    model.refresh_from_db()
    assert not model.source_file and kept() == []


def test_a_refused_upload_keeps_nothing(alice, now, settings):
    upload(alice, now)
    with pytest.raises(UserFault):
        upload_model(
            owner=alice, files=[UploadPart("b.zip", io.BytesIO(b"other"))], name="My car (1)", keep_upload=True, now=now
        )
    assert len(kept()) == 1


def test_an_upload_whose_row_fails_keeps_no_file(alice, now, monkeypatch):
    def broken(*args, **kwargs):
        raise RuntimeError("the database is away")

    monkeypatch.setattr(TrainedModel.objects, "create", broken)
    with pytest.raises(RuntimeError):
        upload(alice, now)
    assert kept() == []


def test_a_damaged_file_is_told_before_a_byte_is_sent(alice, now, tmp_path):
    model = upload(alice, now)
    (tmp_path / model.source_file.name).write_bytes(b"cut")
    with pytest.raises(PlatformFault) as fault:
        upload_of(model)
    assert fault.value.code == "file_damaged"
    (tmp_path / model.source_file.name).unlink()
    with pytest.raises(PlatformFault) as fault:
        upload_of(model)
    assert fault.value.code == "file_damaged"


def test_files_that_no_model_names_are_removed_after_a_day(alice, now, tmp_path):
    model = upload(alice, now)
    (tmp_path / "uploads" / "left").write_bytes(b"by a killed server")
    purge_garages(now=now)
    assert len(kept()) == 2
    purge_garages(now=now + timedelta(days=36500))
    assert kept() == [model.source_file.name.removeprefix("uploads/")]


def test_backups_carry_it():
    assert ("evaluation_trainedmodel", "source_file") in file_columns()


def test_a_model_that_never_was_a_file_has_none(alice):
    with pytest.raises(UserFault) as fault:
        upload_of(model_row(alice))
    assert fault.value.code == "source_not_kept"
