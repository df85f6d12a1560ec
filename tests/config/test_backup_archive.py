"""A backup that is not what was written, to the last byte, is refused."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

import pytest

from config.operations.backup import archive
from paddock.errors import UserFault


@pytest.fixture
def made(tmp_path) -> Path:
    """A backup whose database and file are a few bytes: nothing here comes to restoring them."""
    file = tmp_path / "site.backup"
    with file.open("xb") as target:
        writer = archive.Writer(target, 0)
        writer.add("files/traces/one", io.BytesIO(b"x" * 5000), 5000)
        writer.add(archive.DATABASE, io.BytesIO(b"y" * 5000), 5000)
        facts = {"made_at": "", "database": "sqlite", "migrations": [], "lost": []}
        writer.seal(facts | {"files": ["traces/one"]})
    return file


def test_a_fresh_backup_is_intact(made):
    with archive.opened(made) as backup:
        assert backup.open("files/traces/one").read() == b"x" * 5000


@pytest.mark.parametrize("what", [b"xxxx", b"yyyy", b'"made_at"', b"traces/one"])
def test_a_backup_with_one_changed_byte_is_refused(made, what):
    content = made.read_bytes()
    made.write_bytes(content.replace(what, b"?" + what[1:], 1))
    refused(made)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.6, 0.95])
def test_a_truncated_backup_is_refused(made, share):
    content = made.read_bytes()
    made.write_bytes(content[: int(len(content.rstrip(b"\0")) * share)])
    refused(made)


def test_a_backup_with_an_extra_member_is_refused(made):
    with tarfile.open(made, "a") as tar:
        tar.addfile(tarfile.TarInfo("files/more"), io.BytesIO())
    refused(made)


def test_a_file_that_is_not_a_backup_is_refused(made):
    made.write_text("no backup")
    refused(made)


def refused(made):
    with pytest.raises(UserFault) as told, archive.opened(made):
        pass
    assert told.value.code == "backup_damaged"
