"""The real season of 2022: what our rules make of it, and what the league made of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from django.core.management import call_command

from accounts.models import Racer
from league.models import Season
from tests.postgres import MIGRATED, migrated, postgres
from tests.shared import CHECKOUT, SHARED

RECORD = SHARED / "league-history"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not RECORD.is_dir(), reason="the shared material is not beside this checkout"),
]
AGREEMENT = {
    "races": 28,
    "results": 35_626,
    "racers": 28_641,
    "order": {"pairs": 61_183_122, "agree": 61_183_122},
    "scores": {"checked": 35_621, "agree": 35_621},
    "promotion": {"checked": 1841, "agree": 1840},
    "finale": {"places": 125, "agree": 122},
    "championship": 24,
}
LIMIT_S = 60.0


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.csv")}


@pytest.fixture
def proof(db, capsys) -> dict:
    """What the import of the season says of our rules."""
    started = time.process_time()
    call_command("import_season", RECORD, "--season", "2022", "--json")
    assert time.process_time() - started < LIMIT_S
    return json.loads(capsys.readouterr().out)


def test_our_rules_agree_with_2022(proof):
    assert {name: proof[name] for name in AGREEMENT} == AGREEMENT
    assert len(proof["differences"]["promotion"]) == 1 and len(proof["differences"]["finale"]) == 3
    assert Racer.objects.count() == 28_641 and Season.objects.count() == 1


@pytest.mark.soak  # of small records: tests/league/test_history_export.py, test_history_any.py
def test_importing_2022_again_changes_nothing_and_export_equals_import(proof, tmp_path, capsys):
    call_command("import_season", RECORD, "--season", "2022", "--json")
    assert json.loads(capsys.readouterr().out) == proof
    assert Racer.objects.count() == 28_641 and Season.objects.count() == 1
    call_command("export_season", "2022", tmp_path / "out")
    assert files(tmp_path / "out") == files(RECORD)


@pytest.mark.soak
@pytest.mark.postgres
def test_the_same_on_postgresql(tmp_path, postgresql):
    with postgres(migrated(postgresql), MIGRATED) as url:
        here = os.environ | {"DATABASE_URL": url, "PADDOCK_DATA": str(tmp_path)}

        def manage(*arguments: object) -> str:
            command = [sys.executable, CHECKOUT / "manage.py", *arguments]
            return subprocess.run(
                list(map(str, command)), env=here, check=True, capture_output=True, text=True, cwd=CHECKOUT
            ).stdout

        first = json.loads(manage("import_season", RECORD, "--season", 2022, "--json"))
        assert {name: first[name] for name in AGREEMENT} == AGREEMENT
        assert json.loads(manage("import_season", RECORD, "--season", 2022, "--json")) == first
        manage("export_season", 2022, tmp_path / "out")
        assert files(tmp_path / "out") == files(RECORD)
