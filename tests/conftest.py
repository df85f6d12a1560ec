"""What every test may use."""

from __future__ import annotations

import os
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import pytest

# Tests never touch the checkout's data folder.
os.environ["PADDOCK_DATA"] = tempfile.mkdtemp(prefix="paddock-tests-")
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def django_db_modify_db_settings() -> None:
    """Test on a real SQLite file: in memory there is no WAL, and other threads and processes see nothing."""
    from django.conf import settings

    database = settings.DATABASES["default"]
    if database["ENGINE"] == "django.db.backends.sqlite3":
        database.setdefault("TEST", {})["NAME"] = str(Path(os.environ["PADDOCK_DATA"]) / "test.sqlite3")


@pytest.fixture(scope="session", autouse=True)
def quick_passwords() -> None:
    """Hash passwords once, not hundreds of thousands of times."""
    from django.conf import settings

    settings.PASSWORD_HASHERS = ["django.contrib.auth.hashers.MD5PasswordHasher"]


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
