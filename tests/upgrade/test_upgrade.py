"""The data folder of a released version is upgraded, and every page, board and result answers as before.

``site-VERSION.tar.xz`` is the data folder of a released version, made by its own code (``make.py``), and
``site-VERSION.json`` its answers (``told.py``). A new version may answer more, never less.
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

from tests.shared import CHECKOUT

HERE = Path(__file__).parent
SITES = sorted(path.name.removesuffix(".tar.xz") for path in HERE.glob("site-*.tar.xz"))
# a new version words its rules anew, and the edition of a race hashes all of its fields
OTHERWISE = {"edition", "ranking_rule", "rules", "tie_rule"}


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


def unpacked(site: str, folder: Path) -> Path:
    """The data folder of a site, in a folder that is its owner's alone."""
    data = folder / "data"
    data.mkdir(mode=0o700)
    with tarfile.open(HERE / f"{site}.tar.xz") as archive:
        archive.extractall(data, filter="data")
    return data


def assert_same_answers(site: str, data: Path) -> None:
    record = HERE / f"{site}.json"
    was, now = json.loads(record.read_text()), json.loads(run(data, "-m", "tests.upgrade.told", str(record)))
    assert len(was["files"]) >= 5 and len(was["pages"]["alice"]) >= 50
    assert differences(was, now) == []


def differences(was: Any, now: Any, where: str = "") -> list[str]:
    """Where the answers differ; additional keys are no difference."""
    if isinstance(was, dict) and isinstance(now, dict):
        return [
            one
            for key in was.keys() - OTHERWISE
            for one in (differences(was[key], now[key], f"{where}/{key}") if key in now else [f"{where}/{key} is gone"])
        ]
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        pairs = enumerate(zip(was, now, strict=True))
        return [one for number, pair in pairs for one in differences(*pair, f"{where}/{number}")]
    return [] if was == now else [f"{where}: {was!r} is now {now!r}"]


@pytest.mark.slow
@pytest.mark.parametrize("site", SITES)
def test_an_upgrade_keeps_every_page_board_and_result(site: str, tmp_path: Path) -> None:
    data = unpacked(site, tmp_path)
    run(data, "manage.py", "migrate", "--no-input")
    assert_same_answers(site, data)


def test_a_database_from_before_the_first_release_is_refused_unchanged(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    with closing(sqlite3.connect(tmp_path / "paddock.sqlite3")) as old, old:
        old.execute("CREATE TABLE league_racer (id INTEGER PRIMARY KEY, alias TEXT)")
        old.execute("INSERT INTO league_racer VALUES (1, 'alice')")
        was = list(old.iterdump())
    done = call(tmp_path, "manage.py", "migrate", "--no-input")
    assert done.returncode == 1 and "before 0.1.0" in done.stderr and "Traceback" not in done.stderr
    with closing(sqlite3.connect(tmp_path / "paddock.sqlite3")) as old:
        assert list(old.iterdump()) == was


def test_a_difference_after_the_upgrade_is_found() -> None:
    was = {"a": [{"b": 1}], "edition": "x", "c": 2}
    assert differences(was, {"a": [{"b": 1, "new": 2}], "edition": "y", "c": 2}) == []
    assert differences(was, {"a": [{"b": 2}], "c": 2}) == ["/a/0/b: 1 is now 2"]
    assert differences(was, {"a": [], "c": 2}) == ["/a: [{'b': 1}] is now []"]
    assert differences({"c": 2}, {}) == ["/c is gone"]
