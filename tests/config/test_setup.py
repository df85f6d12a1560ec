"""The command that prepares a site, repeated, at once, and with its admin."""

from __future__ import annotations

import os
import subprocess
import sys
from datetime import date
from io import StringIO
from types import SimpleNamespace

import pytest
from allauth.account.models import EmailAddress
from django.contrib.staticfiles.finders import get_finders
from django.core.files.base import ContentFile
from django.core.files.storage import FileSystemStorage
from django.core.management import call_command
from django.core.management.base import CommandError
from storages.backends.s3 import S3Storage

from accounts.models import Racer
from config.management.commands.setup import PASSWORD
from config.operations import setup as preparation
from config.serving.static_files import StaticFiles
from league.models import Season
from paddock.geometry.catalogue import CATALOGUE
from races.models import Race
from tests.config.test_run import environment, rows
from tests.outages.bucket import BUCKET, S3Server
from tests.shared import CHECKOUT
from tracks.models import Track

ANN = {"admin": "ann", "email": "Ann@example.org"}


@pytest.fixture
def run(db, monkeypatch, capsys, settings, tmp_path):
    """``setup`` with no terminal; what it prints."""
    settings.STATIC_ROOT = tmp_path
    monkeypatch.setattr("sys.stdin", StringIO())
    monkeypatch.delenv(PASSWORD, raising=False)
    umask = os.umask(0o077)

    def setup(**options: object) -> str:
        call_command("setup", **options)
        return capsys.readouterr().out

    yield setup
    os.umask(umask)


@pytest.fixture
def season(db) -> Season:
    """One of the operator's, beside which setup opens none."""
    return Season.objects.create(slug="mine", name="Mine", starts_on=date(2020, 1, 1), ends_on=date(2020, 12, 31))


def test_setup_ends_in_tracks_a_season_and_races_and_changes_nothing_again(run, monkeypatch):
    printed = run()
    assert f"Loading {len(CATALOGUE)} tracks ... " in printed
    assert "There is no admin yet" in printed
    assert Track.objects.filter(is_catalogue=True).count() == len(CATALOGUE)
    assert Season.objects.count() == 1
    races = set(Race.objects.values_list("pk", "slug"))
    assert len(races) > 12
    monkeypatch.setenv(PASSWORD, "correct-horse-7")
    assert "The admin ann was created." in run(**ANN)
    made = Racer.objects.values_list("pk", "password", "email").get(alias="ann")
    assert made[2] == "ann@example.org"
    monkeypatch.setenv(PASSWORD, "another-horse-8")
    assert "The admin ANN exists." in run(**ANN | {"admin": "ANN"})
    assert Racer.objects.values_list("pk", "password", "email").get(alias="ann") == made
    assert set(Race.objects.values_list("pk", "slug")) == races


@pytest.mark.usefixtures("season")
def test_static_files_are_collected_again_only_after_a_change(run, monkeypatch, settings, tmp_path):
    settings.DATA_DIR = tmp_path
    settings.STATIC_ROOT = tmp_path / "static"
    own, collections = tmp_path / "own", []
    own.mkdir()
    (own / "a.css").write_text("a {}")
    storage = FileSystemStorage(own)
    finder = SimpleNamespace(list=lambda ignored: [(name, storage) for name in storage.listdir("")[1]])
    monkeypatch.setattr(preparation, "get_finders", lambda: [*get_finders(), finder])

    def counted(name: str, **options: object) -> None:
        collections.append(name)
        call_command(name, **options)

    monkeypatch.setattr(preparation, "call_command", counted)

    def collections_of_a_setup() -> int:
        collections.clear()
        run()
        return collections.count("collectstatic")

    assert [collections_of_a_setup(), collections_of_a_setup()] == [1, 0]
    (own / "a.css").write_text("b {}")
    assert [collections_of_a_setup(), collections_of_a_setup()] == [1, 0]
    (own / "b.css").write_text("b {}")
    assert [collections_of_a_setup(), collections_of_a_setup()] == [1, 0]
    next((tmp_path / "static").rglob("*.css")).unlink()
    assert [collections_of_a_setup(), collections_of_a_setup()] == [1, 0]


@pytest.mark.usefixtures("season")
def test_static_files_of_an_image_are_left_as_they_are(run, settings, tmp_path):
    settings.STATIC_PREPARED = str(tmp_path)
    assert "static files" not in run()
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("season")
def test_setup_creates_the_bucket_once(run, monkeypatch, settings):
    server = S3Server()
    storage = S3Storage(**server.options())
    settings.STORAGE = f"s3://{BUCKET}"
    monkeypatch.setattr(preparation, "default_storage", storage)
    try:
        assert f"Creating the bucket of s3://{BUCKET}" in run()
        assert storage.save("one.txt", ContentFile(b"one")) == "one.txt"
        assert "bucket" not in run()
        server.be("stopped")
        with pytest.raises(CommandError, match=f"The storage s3://{BUCKET} does not answer"):
            run()
    finally:
        server.close()


def test_a_static_file_that_is_cut_off_is_no_file(tmp_path):
    storage = StaticFiles(location=tmp_path)
    whole = ContentFile(b"a" * 200_000)

    class CutOff(ContentFile):
        def chunks(self, chunk_size=None):
            yield b"a"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        storage.save("one.css", CutOff(b"aa"))
    assert not storage.exists("one.css")
    assert storage.save("one.css", whole) == "one.css"
    assert (tmp_path / "one.css").stat().st_size == 200_000


@pytest.fixture
def admin_only(run, monkeypatch):
    """The admin's part of ``setup``."""
    monkeypatch.setattr("config.management.commands.setup.prepare_site", lambda command, now: None)
    return run


def test_the_admin_may_log_in_where_addresses_must_be_confirmed(admin_only, client, monkeypatch, settings):
    settings.ACCOUNT_EMAIL_VERIFICATION = "mandatory"
    monkeypatch.setenv(PASSWORD, "correct-horse-7")
    admin_only(**ANN)
    assert EmailAddress.objects.filter(email="ann@example.org", verified=True, primary=True).exists()
    client.post("/accounts/login/", {"login": "ann", "password": "correct-horse-7"})
    assert client.get("/admin/").status_code == 200


@pytest.mark.parametrize(
    ("password", "given", "said"),
    [
        (None, ANN, PASSWORD),
        ("", ANN, PASSWORD),
        ("1234", ANN, "too short"),
        ("ann@example", ANN, "similar"),
        ("correct-horse-7", {"admin": "ann"}, "--email"),
        ("correct-horse-7", ANN | {"email": "nobody"}, "valid email"),
        ("correct-horse-7", ANN | {"admin": "a b/c"}, "not created"),
        ("correct-horse-7", ANN | {"email": "bob@example.org"}, "E-mail address already"),
        ("correct-horse-7", ANN | {"admin": "BOB"}, "not created"),
    ],
)
def test_there_is_no_default_password_and_no_half_made_admin(admin_only, bob, monkeypatch, password, given, said):
    if password is not None:
        monkeypatch.setenv(PASSWORD, password)
    with pytest.raises(CommandError, match=said):
        admin_only(**given)
    assert not Racer.objects.filter(is_superuser=True).exists()


def test_at_a_terminal_it_asks_for_the_password(admin_only, monkeypatch):
    typed = StringIO("ann\nann@example.org\n")
    typed.isatty = lambda: True
    monkeypatch.setattr("sys.stdin", typed)
    answers = iter(["correct-horse-7", "correct-horse-8", "correct-horse-7", "correct-horse-7"])
    monkeypatch.setattr("getpass.getpass", lambda prompt: next(answers))
    with pytest.raises(CommandError, match="differ"):
        admin_only(**ANN)
    assert "The admin ann was created." in admin_only()
    assert Racer.objects.get(alias="ann").check_password("correct-horse-7")


@pytest.mark.slow
def test_two_at_once_take_turns(tmp_path, new_data):
    data = new_data(tmp_path / "data")
    command = [sys.executable, "manage.py", "setup", "--no-input"]
    both = [
        subprocess.Popen(command, cwd=CHECKOUT, env=environment(data), stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        for _ in range(2)
    ]
    printed = [process.communicate(timeout=120)[0].decode() for process in both]
    assert [process.returncode for process in both] == [0, 0], printed
    assert rows(data, "select count(*) from league_season") == [(1,)]
    assert rows(data, "select count(*) from tracks_track where is_catalogue") == [(len(CATALOGUE),)]
    assert sum("waiting for its end" in one for one in printed) == 1
