"""What every test may use."""

from __future__ import annotations

import os
import shutil
from datetime import UTC, datetime

import pytest


def pytest_unconfigure(config: pytest.Config) -> None:
    """Delete the tests' data folder (tests/settings.py made it) once the last process has ended."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ["PADDOCK_TEST_DATA"], ignore_errors=True)


@pytest.fixture
def now() -> datetime:
    """A fixed moment, so that no test depends on the clock."""
    return datetime(2026, 11, 15, 12, 0, tzinfo=UTC)


@pytest.fixture
def bell(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    """Every ring of the bell, instead of a broker."""
    from evaluation import tasks

    rings: list[dict] = []
    monkeypatch.setattr(tasks.work, "apply_async", lambda **options: rings.append(options))
    return rings


@pytest.fixture
def alice(db: None):
    """A racer with an alias and nothing else. Bob and Charlie are two more."""
    return _racer("alice")


@pytest.fixture
def bob(db: None):
    return _racer("bob")


@pytest.fixture
def charlie(db: None):
    return _racer("charlie")


@pytest.fixture
def oval(db: None):
    """The catalogue's oval as a row."""
    from tests.rows import track_row

    return track_row("oval")


def _racer(alias: str):
    from league.models import Racer

    return Racer.objects.create_user(alias, f"{alias}@example.org", "correct horse battery")
