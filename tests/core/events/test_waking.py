"""A broker that is away costs a writer of events about a second, once, and loses nothing."""

from __future__ import annotations

from time import monotonic

import pytest

from config.celery import app
from core.events import waking
from core.events.waking import FOLLOW, wake

REALLY_WAKE = wake  # before the tests' own takes its place


@pytest.fixture
def asked(monkeypatch) -> list:
    """What is sent, instead of to a broker."""
    sent: list = []
    monkeypatch.setattr(waking, "_away_until", 0.0)
    monkeypatch.setattr(app, "send_task", lambda name, args, **options: sent.append((name, *args)))
    return sent


def test_a_reader_is_woken_by_task_name(asked):
    REALLY_WAKE("ear")
    assert asked == [(FOLLOW, "ear")]
    app.loader.import_default_modules()
    assert FOLLOW in app.tasks


def test_an_unreachable_broker_is_not_tried_again_immediately(asked, monkeypatch, caplog):
    tries = []

    def refuse(name, **options):
        tries.append(name)
        raise ConnectionRefusedError("nobody there")

    monkeypatch.setattr(app, "send_task", refuse)
    for _ in range(3):
        REALLY_WAKE("ear")
    assert len(tries) == 1 and "does not answer" in caplog.text
    monkeypatch.setattr(waking, "_away_until", monotonic() - 1)
    REALLY_WAKE("ear")
    assert len(tries) == 2
