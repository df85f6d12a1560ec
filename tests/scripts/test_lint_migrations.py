"""A migration that the code before it cannot live with does not pass."""

from __future__ import annotations

import sys

import pytest

from scripts import lint_migrations
from tests.postgres import is_installed


@pytest.fixture
def asked(monkeypatch, tmp_path) -> list:
    """Which migrations the linter is asked about, instead of asking it."""
    asked: list = []
    monkeypatch.setattr(lint_migrations, "lint", lambda found: asked.append(found) or 1)
    monkeypatch.setattr(lint_migrations, "ACCEPTED", tmp_path / "accepted")
    monkeypatch.setattr(lint_migrations, "all_migrations", lambda: [("races", "0001_a"), ("races", "0002_b")])
    monkeypatch.setattr(sys, "argv", ["lint_migrations.py"])
    return asked


def test_only_migrations_newer_than_the_accepted_are_checked(asked):
    lint_migrations.ACCEPTED.write_text("races 0001_a\n")
    assert lint_migrations.main() == 1 and asked == [[("races", "0002_b")]]


def test_accepted_migrations_are_recorded_and_not_checked_again(asked, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["lint_migrations.py", "--accept"])
    assert lint_migrations.main() == 0
    monkeypatch.setattr(sys, "argv", ["lint_migrations.py"])
    assert lint_migrations.main() == 0 and asked == []


def test_a_released_migration_that_was_changed_or_deleted_is_refused(asked, monkeypatch, capsys):
    files = {("races", "0001_a"): "one", ("races", "0002_b"): "two"}
    monkeypatch.setattr(lint_migrations, "digest", lambda app, name: files.get((app, name), ""))
    lint_migrations.ACCEPTED.write_text("races 0001_a  # in two steps\n")
    monkeypatch.setattr(sys, "argv", ["lint_migrations.py", "--release"])
    assert lint_migrations.main() == 0
    assert lint_migrations.ACCEPTED.read_text() == "races 0001_a one  # in two steps\nraces 0002_b two\n"
    monkeypatch.setattr(sys, "argv", ["lint_migrations.py"])
    assert lint_migrations.main() == 0 and asked == []
    files["races", "0001_a"] = "another"
    del files["races", "0002_b"]
    assert lint_migrations.main() == 1 and asked == []
    assert "races.0001_a races.0002_b" in capsys.readouterr().err


def test_what_was_not_released_may_change(asked, monkeypatch):
    lint_migrations.ACCEPTED.write_text("races 0001_a\nraces 0002_b\n")
    monkeypatch.setattr(lint_migrations, "digest", lambda app, name: "another")
    assert lint_migrations.main() == 0 and asked == []


def test_recorded_and_existing_migrations_are_the_same():
    known = lint_migrations.all_migrations()
    accepted = lint_migrations.accepted_migrations()
    assert {app for app, _name in known} == {
        *("accounts", "core", "courses", "evaluation", "league", "races", "tracks", "training", "videos"),
    }
    assert accepted and accepted.keys() <= set(known)


@pytest.mark.slow
@pytest.mark.postgres
@pytest.mark.skipif(not is_installed(), reason="PostgreSQL is not installed")
def test_a_new_column_that_old_code_cannot_fill_is_refused(capfd):
    settings = {"DJANGO_SETTINGS_MODULE": "tests.scripts.careless.settings"}
    assert lint_migrations.lint([("careless", "0002_colour")], settings) == 1
    said = capfd.readouterr()
    assert "NOT NULL constraint on columns" in said.out + said.err and "In two steps" in said.err
