"""The cast of the race room: nobody's broker rings."""

from __future__ import annotations

import pytest
from django.db import transaction


@pytest.fixture(autouse=True)
def _no_broker(bell: list[dict]) -> None:
    """Submissions ring the bell; no test here needs a worker to hear it."""


@pytest.fixture
def commits(django_capture_on_commit_callbacks, monkeypatch):
    """What waits for the commit is done at once: a test's own transaction never commits."""
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())
