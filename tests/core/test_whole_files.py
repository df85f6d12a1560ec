"""Stored files are whole: a full disk and a killed process leave nothing behind."""

from __future__ import annotations

import errno
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta

import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.core.files.uploadedfile import SimpleUploadedFile
from django.core.files.uploadhandler import TemporaryFileUploadHandler
from django.test import Client
from django.utils import timezone

from core.files.atomic_storage import UNFINISHED
from core.jobs.outages import storage_answers
from evaluation.garage.services import purge_garages


@pytest.fixture(autouse=True)
def own_files(settings, tmp_path):
    default = settings.STORAGES["default"]
    options = {**default["OPTIONS"], "location": tmp_path}
    settings.STORAGES = {**settings.STORAGES, "default": {**default, "OPTIONS": options}}


@contextmanager
def full_disk() -> Iterator[None]:
    """No file may become longer than 64 kB: the kernel refuses the write, as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (65_536, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def everything() -> list[str]:
    return [os.path.join(folder, name) for folder, _, names in os.walk(default_storage.location) for name in names]


@pytest.mark.parametrize("name", ["networks/a.onnx", "traces/a.csv.gz", "videos/a.mp4"])
def test_a_write_that_is_cut_short_leaves_no_file(name):
    with full_disk(), pytest.raises(OSError, match=os.strerror(errno.EFBIG)):
        default_storage.save(name, ContentFile(bytes(200_000)))

    assert everything() == []


def test_a_probe_that_is_cut_short_leaves_no_file(monkeypatch):
    """The sweep probes once a minute for as long as the disk is full."""

    def full(self: ContentFile, chunk_size: int | None = None) -> Iterator[bytes]:
        yield b"begun"
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(ContentFile, "chunks", full)

    assert not storage_answers()
    assert everything() == []


def test_a_taken_name_is_not_overwritten():
    names = [default_storage.save("networks/a.onnx", ContentFile(content)) for content in (b"first", b"second")]

    assert names[0] == "networks/a.onnx" != names[1]
    assert [default_storage.open(name).read() for name in names] == [b"first", b"second"]
    assert {os.stat(path).st_mode & 0o777 for path in everything()} == {0o600}
    assert len(everything()) == 2


def test_a_name_that_is_taken_meanwhile_is_not_overwritten():
    """Two uploads of the same network at once."""
    default_storage.save("networks/a.onnx", ContentFile(b"first"))
    second = default_storage._save("networks/a.onnx", ContentFile(b"second"))

    assert default_storage.open("networks/a.onnx").read() == b"first"
    assert default_storage.open(second).read() == b"second"


@pytest.mark.django_db
def test_what_a_killed_process_left_is_deleted_after_a_day():
    default_storage.save("traces/a.csv.gz", ContentFile(b"whole"))
    left, now = default_storage.path(f"{UNFINISHED}/left"), timezone.now()
    with open(left, "wb") as file:
        file.write(b"half")

    purge_garages(now=now)
    assert os.path.exists(left)

    purge_garages(now=now + timedelta(days=40))
    assert [os.path.basename(path) for path in everything()] == ["a.csv.gz"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.django_db
def test_an_upload_that_finds_the_disk_full_is_answered_503(alice, monkeypatch, code):
    """Django stores a large upload while the check against forged requests reads the form, before the view."""

    def full(*args: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(TemporaryFileUploadHandler, "receive_data_chunk", full)
    client = Client(enforce_csrf_checks=True, raise_request_exception=False)
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    client.cookies["csrftoken"] = "a" * 32

    answer = client.post("/models/upload/", {"files": SimpleUploadedFile("model.onnx", bytes(3 << 20))})

    assert answer.status_code == 503
    assert answer["Retry-After"]
