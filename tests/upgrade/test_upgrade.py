"""A site of an older version is upgraded, and tells the same as before: every page, every board, every result.

``site-N.tar.xz`` is the data folder of a version that was released, made by its own code (``make.py``), and
``site-N.json`` what it told then (``told.py``). What a new version tells besides is no matter; what it no longer tells
is.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any

import pytest

from tests.shared import CHECKOUT

HERE = Path(__file__).parent
SITES = sorted(path.name.removesuffix(".tar.xz") for path in HERE.glob("site-*.tar.xz"))
# of another version by right: an edition is another where a race has more fields
OTHERWISE = {"edition"}


def run(data: Path, *arguments: str) -> str:
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PADDOCK_", "DJANGO_"))}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=CHECKOUT,
        env={**environment, "PADDOCK_DATA": str(data), "PYTHONWARNINGS": "ignore"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def differences(was: Any, now: Any, where: str = "") -> list[str]:
    """Where what was told is not what is told now; more keys are no difference."""
    if isinstance(was, dict) and isinstance(now, dict):
        return [
            one
            for key in was.keys() - OTHERWISE
            for one in (
                differences(was[key], now[key], f"{where}/{key}") if key in now else [f"{where}/{key} is not told"]
            )
        ]
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        pairs = enumerate(zip(was, now, strict=True))
        return [one for number, pair in pairs for one in differences(*pair, f"{where}/{number}")]
    return [] if was == now else [f"{where}: {was!r} is now {now!r}"]


@pytest.mark.slow
@pytest.mark.parametrize("site", SITES)
def test_every_page_every_board_and_every_result_are_there_after_an_upgrade(site, tmp_path):
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    with tarfile.open(HERE / f"{site}.tar.xz") as archive:
        archive.extractall(data, filter="data")
    run(data, "manage.py", "migrate", "--no-input", "--verbosity", "0")
    record = HERE / f"{site}.json"
    was, now = json.loads(record.read_text()), json.loads(run(data, "-m", "tests.upgrade.told", str(record)))
    assert len(was["files"]) >= 5 and len(was["pages"]["alice"]) >= 50
    assert differences(was, now) == []


def test_a_difference_is_found():
    was = {"a": [{"b": 1}], "edition": "x", "c": 2}
    assert differences(was, {"a": [{"b": 1, "new": 2}], "edition": "y", "c": 2}) == []
    assert differences(was, {"a": [{"b": 2}], "c": 2}) == ["/a/0/b: 1 is now 2"]
    assert differences(was, {"a": [], "c": 2}) == ["/a: [{'b': 1}] is now []"]
    assert differences({"c": 2}, {}) == ["/c is not told"]
