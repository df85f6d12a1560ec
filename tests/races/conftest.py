"""The cast of the race room: no broker is called."""

from __future__ import annotations

import pytest
from django.db import transaction


@pytest.fixture(autouse=True)
def _no_broker(wakes: list[dict]) -> None:
    """Submissions send wake-ups; no test here needs a worker to take them."""


@pytest.fixture
def commits(django_capture_on_commit_callbacks, monkeypatch):
    """What waits for the commit is done at once: a test's own transaction never commits."""
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())
