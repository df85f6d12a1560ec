"""A site from before 0.1.0 is carried over, and tells the same as before: every page, every board, every result.

``site-N.tar.xz`` is the data folder of a version that was released, made by its own code (``make.py``), and
``site-N.json`` what it told then (``told.py``). What a new version tells besides is no matter; what it no longer tells
is.
"""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
import tarfile
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from django.db import IntegrityError

from accounts.models import Racer
from config.carry_over import carry_over
from paddock.errors import UserFault
from races.models import Entry, Race
from races.selectors.counting import totals_of
from tests.shared import CHECKOUT

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
SITES = sorted(path.name.removesuffix(".tar.xz") for path in HERE.glob("site-*.tar.xz"))
# of another version by right: an edition is another where a race has more fields, and rules are sentences
OTHERWISE = {"edition", "ranking_rule", "rules", "tie_rule"}
RENAMED = {"line": "trajectory"}  # a key of then: its name now


def call(data: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PADDOCK_", "DJANGO_"))}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=CHECKOUT,
        env={**environment, "PADDOCK_DATA": str(data), "PYTHONWARNINGS": "ignore"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def run(data: Path, *arguments: str) -> str:
    done = call(data, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def differences(was: Any, now: Any, where: str = "") -> list[str]:
    """Where what was told is not what is told now; more keys are no difference."""
    if isinstance(was, dict) and isinstance(now, dict):
        return [
            one
            for key in was.keys() - OTHERWISE
            for new in [RENAMED.get(key, key)]
            for one in (
                differences(was[key], now[new], f"{where}/{key}") if new in now else [f"{where}/{key} is not told"]
            )
        ]
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        pairs = enumerate(zip(was, now, strict=True))
        return [one for number, pair in pairs for one in differences(*pair, f"{where}/{number}")]
    return [] if was == now else [f"{where}: {was!r} is now {now!r}"]


@pytest.mark.slow
@pytest.mark.parametrize("site", SITES)
def test_an_upgrade_keeps_every_page_board_and_result(site, tmp_path):
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    with tarfile.open(HERE / f"{site}.tar.xz") as archive:
        archive.extractall(data, filter="data")
    (data / "paddock.sqlite3").rename(tmp_path / "before.sqlite3")
    assert "Carried over" in run(data, "manage.py", "carry_over", str(tmp_path / "before.sqlite3"))
    record = HERE / f"{site}.json"
    was, now = json.loads(record.read_text()), json.loads(run(data, "-m", "tests.upgrade.told", str(record)))
    assert len(was["files"]) >= 5 and len(was["pages"]["alice"]) >= 50
    assert differences(was, now) == []


@pytest.fixture
def before(tmp_path: Path) -> Path:
    """The database of the newest site from before."""
    with tarfile.open(HERE / f"{SITES[-1]}.tar.xz") as archive:
        archive.extract("paddock.sqlite3", tmp_path, filter="data")
    return tmp_path / "paddock.sqlite3"


def test_an_old_database_is_not_migrated_in_place(before, tmp_path):
    tmp_path.chmod(0o700)
    with closing(sqlite3.connect(before)) as old:
        was = list(old.iterdump())
    done = call(tmp_path, "manage.py", "migrate", "--no-input")
    assert done.returncode != 0 and "manage.py carry_over" in done.stderr
    with closing(sqlite3.connect(before)) as old:
        assert list(old.iterdump()) == was


@pytest.mark.django_db
class TestRefusals:
    def refused(self, source) -> UserFault:
        with pytest.raises(UserFault) as caught:
            carry_over(str(source))
        assert not Racer.objects.exclude(alias="alice").exists() and not Race.objects.exists()
        return caught.value

    def test_a_site_with_racers_is_not_overwritten(self, before, alice):
        assert self.refused(before).code == "carry_not_empty"

    def test_a_missing_or_invalid_database_file_is_named(self, tmp_path):
        assert self.refused(tmp_path / "none").params["problem"] == "no such file"
        (tmp_path / "text").write_text("no database" * 500)
        assert "not a database" in self.refused(tmp_path / "text").params["problem"]
        assert self.refused("nonsense://somewhere").code == "carry_unreadable"

    def test_another_kind_of_database_is_refused(self):
        assert self.refused("postgres://localhost/paddock").params == {"theirs": "postgresql", "ours": "sqlite"}

    def test_an_even_older_database_is_refused(self, before):
        with closing(sqlite3.connect(before)) as old, old:
            old.execute("DELETE FROM django_migrations WHERE name = '0013_turns'")
        assert self.refused(before).params["found"] == "evaluation.0013_turns"

    def test_an_unmapped_column_is_refused(self, before):
        with closing(sqlite3.connect(before)) as old, old:
            old.execute("ALTER TABLE league_racer ADD COLUMN colour TEXT")
        assert self.refused(before).params["found"] == "league_racer.colour"

    def test_a_row_with_a_dangling_reference_changes_nothing(self, before):
        with closing(sqlite3.connect(before)) as old, old:
            old.execute("DELETE FROM tracks_track")
        with pytest.raises(IntegrityError):
            carry_over(str(before))
        assert not Racer.objects.exists()


@pytest.mark.django_db
def test_permissions_are_carried_over_by_name(before):
    with closing(sqlite3.connect(before)) as old, old:
        [[racer]] = old.execute("SELECT id FROM league_racer WHERE alias = 'alice'")
        [[permission]] = old.execute("SELECT id FROM auth_permission WHERE codename = 'change_racer'")
        old.execute(
            "INSERT INTO league_racer_user_permissions (racer_id, permission_id) VALUES (?, ?)", (racer, permission)
        )
    carry_over(str(before))
    assert Racer.objects.get(alias="alice").has_perm("accounts.change_racer")
    assert Entry.objects.count() == 6
    assert totals_of(Race.objects.get(name="Before the upgrade")).racers == 2


def test_a_difference_after_the_upgrade_is_found():
    was = {"a": [{"b": 1}], "edition": "x", "c": 2}
    assert differences(was, {"a": [{"b": 1, "new": 2}], "edition": "y", "c": 2}) == []
    assert differences(was, {"a": [{"b": 2}], "c": 2}) == ["/a/0/b: 1 is now 2"]
    assert differences(was, {"a": [], "c": 2}) == ["/a: [{'b': 1}] is now []"]
    assert differences({"c": 2}, {}) == ["/c is not told"]
