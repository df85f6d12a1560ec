"""What stands in the environment: nonsense is refused with the variable's name, in a sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from django.core.exceptions import ImproperlyConfigured

from config.settings import env
from config.settings.env import env_int
from tests.shared import CHECKOUT


@pytest.mark.parametrize(("value", "problem"), [("1", "at least 2"), ("33", "at most 32"), ("many", "whole number")])
def test_a_number_out_of_range_is_refused(monkeypatch, value, problem):
    monkeypatch.setenv("PADDOCK_DUELS_IN_ROUND_ROBIN", value)
    with pytest.raises(ImproperlyConfigured, match=f"PADDOCK_DUELS_IN_ROUND_ROBIN must be .*{problem}"):
        env_int("PADDOCK_DUELS_IN_ROUND_ROBIN", 16, minimum=2, maximum=32)


def test_a_number_in_range_is_accepted_and_none_is_the_default(monkeypatch):
    monkeypatch.setenv("PADDOCK_DUELS_IN_ROUND_ROBIN", "32")
    assert env_int("PADDOCK_DUELS_IN_ROUND_ROBIN", 16, minimum=2, maximum=32) == 32
    monkeypatch.delenv("PADDOCK_DUELS_IN_ROUND_ROBIN")
    assert env_int("PADDOCK_DUELS_IN_ROUND_ROBIN", 16, minimum=2, maximum=32) == 16


HTTP = ("http", "https")
REDIS = ("redis", "unix")


def url(name: str) -> str:
    return env.env_url(name, "http://127.0.0.1:8000", HTTP, "https://paddock.example.org")


def redis(name: str) -> str:
    return env.env_url(name, "redis://h", REDIS, "redis://host:6379/1")


def hosts(name: str) -> list[str]:
    return env.env_hosts(name, "localhost")


def database(name: str) -> dict:
    return env.env_database(name, "sqlite:////tmp/none.sqlite3")


def zone(name: str) -> str:
    return env.env_time_zone(name, "UTC")


def sender(name: str) -> str:
    return env.env_sender(name, "paddock@localhost")


def level(name: str) -> str:
    return env.env_choice(name, "INFO", ("DEBUG", "INFO"))


def folder(name: str) -> Path:
    return env.env_folder(name, Path("/tmp"))


REFUSED = [
    *((url, value) for value in ("ftp://x", "http://", "http://a:b", "http://a:99999", "example.org", "http://a b")),
    *((redis, value) for value in ("garbage", "redis://h:abc/1", "amqp://h", "redis://")),
    *((hosts, value) for value in ("bad host", "http://a", "a.example:8000", "a,b/c", "..")),
    *((database, value) for value in ("garbage", "nosuch://x/y", "postgres://h:abc/db", "mysql://u@h/db", "://")),
    *((zone, value) for value in ("Mars/Phobos", "../../etc", "", "Europe", "/etc/localtime")),
    *((sender, value) for value in ("not an address", "", "@", "a@b\nBcc: c@d")),
    *((level, value) for value in ("LOUD", "debug", "")),
    *((folder, value) for value in ("/proc/nope", "/etc/hostname", "/etc/hostname/below", "~nobody-has-this-name/x")),
]


@pytest.mark.parametrize(("reader", "value"), REFUSED)
def test_an_invalid_value_is_refused_naming_the_variable(monkeypatch, reader, value):
    monkeypatch.setenv("PADDOCK_ANYTHING", value)
    with pytest.raises(ImproperlyConfigured, match=r"^PADDOCK_ANYTHING must be ") as refusal:
        reader("PADDOCK_ANYTHING")
    assert refusal.value.__suppress_context__ or refusal.value.__context__ is None


@pytest.mark.parametrize(
    ("reader", "value"),
    [
        *((url, value) for value in ("https://race.example.org", "http://[::1]:8000/", "http://127.0.0.1")),
        *((redis, value) for value in ("redis://:secret@h:6379/1", "unix:///run/valkey.sock?db=1")),
        *((hosts, value) for value in ("a.example,b", "*", ".example.org", "[::1]", "")),
        *((database, value) for value in ("postgres://u:p@h:5432/n", "sqlite:////tmp/x.sqlite3", "postgresql://h/n")),
        *((zone, value) for value in ("UTC", "Asia/Seoul")),
        *((sender, value) for value in ("paddock@localhost", "The League <race@example.org>")),
        (level, "DEBUG"),
    ],
)
def test_a_valid_value_is_accepted(monkeypatch, reader, value):
    monkeypatch.setenv("PADDOCK_ANYTHING", value)
    reader("PADDOCK_ANYTHING")


def test_a_refused_url_is_not_printed_with_its_password(monkeypatch):
    monkeypatch.setenv("DATABASE_URL", "postgres://paddock:hunter2@h:port/db")
    for reader in (database, url):
        with pytest.raises(ImproperlyConfigured) as refusal:
            reader("DATABASE_URL")
        assert "hunter2" not in str(refusal.value)


def test_a_new_folder_is_accessible_to_its_owner_only(monkeypatch, tmp_path):
    monkeypatch.setenv("PADDOCK_DATA", str(tmp_path / "new" / "data"))
    assert folder("PADDOCK_DATA").stat().st_mode & 0o777 == 0o700


@pytest.mark.slow
@pytest.mark.parametrize(
    "setting",
    [
        "DATABASE_URL=garbage",
        "EMAIL_URL=smtp://h:abc",
        "PADDOCK_TIME_ZONE=Mars",
        "PADDOCK_DATA=/etc/hostname",
        "PADDOCK_SANDBOX_LEVEL=1",
        "PADDOCK_SANDBOX_UIDS=5-1",
    ],
)
def test_the_command_line_prints_one_line_without_a_traceback(setting, tmp_path):
    name, value = setting.split("=", 1)
    environment = {
        **os.environ,
        "PADDOCK_DATA": str(tmp_path),
        "DJANGO_SETTINGS_MODULE": "config.settings",
        name: value,
    }
    done = subprocess.run(
        [sys.executable, "manage.py", "run"], cwd=CHECKOUT, env=environment, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"Paddock cannot start: {name}") and done.stderr.count("\n") == 1


class TestSecretsFolder:
    @pytest.fixture
    def open_one(self, tmp_path: Path) -> Path:
        made = tmp_path / "data"
        made.mkdir()
        made.chmod(0o755)
        return made

    @pytest.mark.parametrize("inside", [[], ["secret-key", "notes.txt"], ["locks"], ["valkey"]])
    def test_a_folder_readable_by_others_is_closed_and_reported(self, open_one, inside, capsys):
        for name in inside:
            (open_one / name).touch()
        assert env.private_folder("PADDOCK_DATA", open_one) == open_one
        assert open_one.stat().st_mode & 0o777 == 0o700
        assert "was open to other users" in capsys.readouterr().err
        env.private_folder("PADDOCK_DATA", open_one)
        assert capsys.readouterr().err == "", "once"

    @pytest.mark.parametrize(
        ("change", "why"),
        [
            (lambda folder: (folder / "letters.txt").touch(), "not Paddock's"),
            (lambda folder: folder.chmod(0o1777), "not Paddock's"),
        ],
        ids=["somebody's home", "a folder for all"],
    )
    def test_a_folder_others_may_need_is_refused_and_left_open(self, open_one, change, why):
        change(open_one)
        mode = open_one.stat().st_mode
        with pytest.raises(ImproperlyConfigured, match=why):
            env.private_folder("PADDOCK_DATA", open_one)
        assert open_one.stat().st_mode == mode

    def test_a_folder_of_another_user_is_refused(self, open_one, monkeypatch):
        monkeypatch.setattr(env.os, "geteuid", lambda: open_one.stat().st_uid + 1)
        with pytest.raises(ImproperlyConfigured, match="belongs to somebody else"):
            env.private_folder("PADDOCK_DATA", open_one)

    def test_a_folder_that_cannot_be_closed_is_refused(self, open_one, monkeypatch):
        def refuse(self: Path, mode: int) -> None:
            raise PermissionError(1, "Operation not permitted")

        monkeypatch.setattr(Path, "chmod", refuse)
        with pytest.raises(ImproperlyConfigured, match="cannot be closed: Operation not permitted"):
            env.private_folder("PADDOCK_DATA", open_one)
