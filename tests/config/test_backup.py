"""A backup is made while the site runs, and what is restored from it is the same site."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
import threading
from contextlib import closing, contextmanager
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import psycopg
import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage
from django.core.management import call_command
from django.db import connection
from django.utils import timezone

from config.operations.backup import archive, databases, making, restoring
from config.operations.backup.files import working_folder
from config.operations.backup.making import back_up
from core.management.base import Refusal
from evaluation.models import Network, Result
from paddock.errors import PaddockError, PlatformFault
from races.models import Submission
from tests.config.backed_up import answers
from tests.factories import a_race, a_racer, drive, laps
from tests.shared import CHECKOUT

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def storage(settings, tmp_path):
    """The site's stored files, in a folder of this test's own."""
    options = settings.STORAGES["default"] | {"OPTIONS": {"location": tmp_path / "files"}}
    settings.STORAGES = {**settings.STORAGES, "default": options}
    return tmp_path / "files"


@pytest.fixture
def race(storage, wakes):
    """A race with three cars that have driven."""
    now = timezone.now()
    race = a_race(now, slug="the-race")
    for number in range(3):
        drive(race, a_racer(f"racer-{number}-of-backup"), laps(10_000 + number, 9_000, 9_500), now)
    return race


@pytest.fixture
def file(tmp_path) -> Path:
    return tmp_path / "site.backup"


def addresses() -> list[str]:
    """Pages and files that show what is stored."""
    runs = [one.evaluation.public_id for one in Submission.objects.order_by("pk")]
    files = ("", "trace.csv", "replay.json", "metrics.json")
    return [
        *("/races/the-race/", "/races/the-race/rules/", "/races/the-race/board.csv", "/races/the-race/runs/"),
        *(f"/evaluations/{run}/{name}" for run in runs for name in files),
    ]


@contextmanager
def empty_place(tmp_path):
    """The environment of a site without anything, with a database of the kind that this one has."""
    keep = {name: os.environ[name] for name in ("PATH", "HOME", "LANG") if name in os.environ}
    environment = {**keep, "PADDOCK_DATA": str(tmp_path / "restored"), "OMP_NUM_THREADS": "1"}
    if connection.vendor == "sqlite":
        yield environment
        return
    params = {name: connection.get_connection_params()[name] for name in ("user", "host")}
    with psycopg.connect(dbname="postgres", autocommit=True, **params) as server:
        server.execute("CREATE DATABASE restored")
        try:
            yield environment | {"DATABASE_URL": os.environ["DATABASE_URL"].rpartition("/")[0] + "/restored"}
        finally:
            server.execute("DROP DATABASE restored WITH (FORCE)")


def command(environment, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments], cwd=CHECKOUT, env=environment, capture_output=True, text=True, timeout=100
    )


@pytest.mark.slow
def test_a_restored_site_serves_the_same_pages_and_files(race, file, tmp_path):
    asked = addresses()
    before = answers("racer-0-of-backup", asked)
    assert {status for status, _ in before.values()} == {200}
    with writing_on(a_race(timezone.now())):
        call_command("backup", str(file), stderr=StringIO(), stdout=StringIO())
    with empty_place(tmp_path) as environment:
        restored = command(environment, "manage.py", "restore", str(file))
        assert restored.returncode == 0, restored.stderr
        after = command(environment, "-m", "tests.config.backed_up", "racer-0-of-backup", *asked)
        again = command(environment, "manage.py", "restore", str(file))
    assert json.loads(after.stdout) == before
    assert again.returncode == 2
    assert "restore_not_empty" in again.stderr
    assert (file.stat().st_mode & 0o777) == 0o600
    if connection.vendor == "sqlite":
        assert {path.stat().st_mode & 0o077 for path in (tmp_path / "restored").rglob("*.gz")} == {0}


@contextmanager
def writing_on(race):
    """Cars that drive, and files that come and go, for as long as the block takes."""
    ended, failed, driven = threading.Event(), [], []

    def write() -> None:
        try:
            while not ended.is_set():
                now = timezone.now()
                submission = drive(race, a_racer(), laps(9_000, 9_000, 9_000), now)
                driven.append(submission)
                network = submission.evaluation.model.network
                gone = Network(sha256=f"{len(driven):064x}", size=1, parameters=1, macs=1)
                gone.onnx.save("gone.onnx", ContentFile(b"gone"), save=False)
                gone.save()
                gone.delete()
                default_storage.delete(gone.onnx.name)
                assert default_storage.exists(network.onnx.name)
        except Exception as error:
            failed.append(error)
        finally:
            connection.close()

    writer = threading.Thread(target=write)
    writer.start()
    try:
        yield driven
    finally:
        ended.set()
        writer.join()
    assert not failed
    assert driven


def test_a_backup_during_writes_holds_every_referenced_file(race, file):
    with writing_on(race) as driven:
        while not driven:
            pass
        made = back_up(path=file, now=timezone.now())
    assert made.lost == []
    with archive.opened(file) as backup:
        assert len(backup.files) == made.files >= 6
        assert set(backup.files) >= set(Result.objects.order_by("pk").values_list("trace", flat=True)[:3])
        assert all(archive.FILES + name in backup for name in backup.files)


def test_a_file_vanishing_midway_makes_the_backup_start_over(race, file, monkeypatch):
    moments = []

    @contextmanager
    def while_one_comes_and_goes(folder):
        network = Network(sha256="e" * 64, size=1, parameters=1, macs=1)
        if not moments:
            network.onnx.save("short.onnx", ContentFile(b"short"), save=False)
            network.save()
        with databases.snapshot(folder) as moment:
            moments.append(moment.files)
            if len(moments) == 1:
                network.delete()
                default_storage.delete(network.onnx.name)
            yield moment

    monkeypatch.setattr(making, "snapshot", while_one_comes_and_goes)
    made = back_up(path=file, now=timezone.now())
    assert len(moments) == 2
    assert len(moments[0] - moments[1]) == 1
    assert made.lost == []


def test_a_lost_file_is_named_and_the_rest_is_saved(race, file):
    lost = Result.objects.order_by("pk").first().trace.name
    default_storage.delete(lost)
    said = StringIO()
    with pytest.raises(SystemExit) as ended:
        call_command("backup", str(file), stderr=said, stdout=StringIO())
    assert ended.value.code == 1
    assert lost in said.getvalue()
    with archive.opened(file) as backup:
        assert backup.manifest["lost"] == [lost]
        assert len(backup.files) == 5


def test_a_damaged_file_is_saved_as_it_is_and_named(race, file, storage):
    damaged = Result.objects.order_by("pk").first().trace.name
    (storage / damaged).write_bytes(b"")
    made = back_up(path=file, now=timezone.now())
    assert (made.damaged, made.lost) == ([damaged], [])
    with archive.opened(file) as backup:
        assert damaged in backup.files


def test_an_existing_file_is_not_overwritten(race, file):
    file.write_text("precious")
    with pytest.raises(Refusal, match="backup_exists"):
        call_command("backup", str(file))
    assert file.read_text() == "precious"


def test_a_failed_backup_leaves_nothing_behind(race, file, monkeypatch):
    def away(self, name, mode="rb"):
        raise OSError("the bucket does not answer")

    monkeypatch.setattr(type(default_storage), "open", away, raising=False)
    with pytest.raises(Refusal, match="storage_failed"):
        call_command("backup", str(file), verbosity=0)
    assert sorted(path.name for path in file.parent.iterdir()) == ["files"]


class TestKilled:
    """What a killed backup or restore leaves is deleted by the next one; what another one uses now stays."""

    def test_the_next_backup_deletes_what_a_killed_one_left(self, race, tmp_path):
        folder = tmp_path / "backups"
        folder.mkdir()
        code = (
            "import os, pathlib, signal\n"
            "from config.operations.backup.making import UNFINISHED\n"
            "from config.operations.backup.files import working_folder\n"
            f"with working_folder(pathlib.Path({str(folder)!r}), UNFINISHED) as place:\n"
            "    (place / 'backup').write_bytes(b'half')\n"
            "    os.kill(os.getpid(), signal.SIGKILL)\n"
        )
        environment = os.environ | {"DJANGO_SETTINGS_MODULE": "tests.settings"}
        code = f"import django; django.setup()\n{code}"
        killed = subprocess.run([sys.executable, "-c", code], cwd=CHECKOUT, env=environment, capture_output=True)
        assert killed.returncode == -9, killed.stderr
        assert len(list(folder.iterdir())) == 1
        call_command("backup", str(folder / "monday.backup"), verbosity=0)
        assert [path.name for path in folder.iterdir()] == ["monday.backup"]

    def test_two_backups_at_a_time_leave_each_other_alone(self, race, tmp_path):
        with working_folder(tmp_path, making.UNFINISHED) as other:
            call_command("backup", str(tmp_path / "second.backup"), verbosity=0)
            assert other.is_dir()
        assert not other.exists()

    def test_the_next_restore_deletes_what_a_killed_one_left(self, tmp_path):
        (tmp_path / "restore-1234" / "deep").mkdir(parents=True)
        (tmp_path / "restore-list.txt").write_text("somebody's")
        with working_folder(tmp_path, restoring.UNFINISHED):
            assert not (tmp_path / "restore-1234").exists()
        assert [path.name for path in tmp_path.iterdir()] == ["restore-list.txt"]


def test_a_missing_folder_is_named(race, tmp_path):
    with pytest.raises(Refusal, match="file_unwritable"):
        call_command("backup", str(tmp_path / "none" / "site.backup"))


class TestRestoring:
    def test_restoring_over_a_database_is_refused(self, race, file):
        back_up(path=file, now=timezone.now())
        with pytest.raises(PaddockError) as refused:
            restoring.restore(path=file)
        assert refused.value.code == "restore_not_empty"
        assert Submission.objects.count() == 3

    def test_restoring_over_other_files_is_refused(self, race, file, monkeypatch, storage):
        back_up(path=file, now=timezone.now())
        monkeypatch.setattr(databases, "is_empty", lambda: True)
        monkeypatch.setattr(databases, "restore_from", lambda path: pytest.fail("not to be restored"))
        (storage / "traces" / "other").write_text("of somebody else")
        with pytest.raises(PaddockError) as refused:
            restoring.restore(path=file)
        assert refused.value.code == "restore_not_empty"

    def test_an_interrupted_restore_can_be_repeated(self, race, file, monkeypatch, storage, settings, tmp_path):
        back_up(path=file, now=timezone.now())
        next((storage / "traces").iterdir()).unlink()  # as if it had come so far
        restored = []
        monkeypatch.setattr(databases, "is_empty", lambda: True)
        monkeypatch.setattr(databases, "restore_from", lambda path: restored.append(path.stat().st_size))
        settings.DATA_DIR = tmp_path
        assert restoring.restore(path=file).files == 6
        assert len(restored) == 1
        assert len(list((storage / "traces").iterdir())) == 3

    @pytest.mark.parametrize(
        ("change", "code"),
        [
            ({"database": "oracle"}, "backup_other_database"),
            ({"migrations": ["evaluation.9999_later"]}, "backup_newer"),
        ],
    )
    def test_restoring_an_unsuitable_backup_is_refused(self, change, code, file):
        facts = {"made_at": "", "database": connection.vendor, "migrations": [], "files": [], "lost": []}
        with file.open("xb") as target:
            archive.Writer(target, 0).seal(facts | change)
        with pytest.raises(PaddockError) as refused:
            restoring.restore(path=file)
        assert refused.value.code == code


@pytest.mark.skipif("connection.vendor != 'sqlite'")
def test_a_damaged_database_is_not_restored(race, file, tmp_path, monkeypatch):
    broken = tmp_path / "broken.sqlite3"
    with databases.snapshot(tmp_path) as moment:
        content = bytearray(moment.path.read_bytes())
        with closing(sqlite3.connect(moment.path)) as database:
            (size,) = database.execute("PRAGMA page_size").fetchone()
            (root,) = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'races_race'").fetchone()
    content[(root - 1) * size : root * size] = bytes(size)
    broken.write_bytes(content)
    monkeypatch.setattr(databases, "_sqlite_path", lambda: broken)
    with pytest.raises(PlatformFault) as refused:
        back_up(path=file, now=timezone.now())
    assert refused.value.code == "database_damaged"
    assert not file.exists()


def test_missing_or_old_postgresql_tools_are_named_with_a_package(monkeypatch, tmp_path):
    server = SimpleNamespace(pg_version=99_0001, ensure_connection=lambda: None)
    monkeypatch.setattr(databases, "connection", server)
    with pytest.raises(PaddockError, match="postgresql-client-99"):
        databases._tool("pg_dump")


@pytest.mark.soak
@pytest.mark.postgres
def test_the_same_on_postgresql(again_on_postgresql):
    tests = (
        test_a_restored_site_serves_the_same_pages_and_files,
        test_a_backup_during_writes_holds_every_referenced_file,
        TestRestoring.test_restoring_over_a_database_is_refused,
    )
    again_on_postgresql(*(f"{__file__}::{test.__qualname__.replace('.', '::')}" for test in tests))
