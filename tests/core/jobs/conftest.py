"""One kind of job after the other, with one that waits."""

from __future__ import annotations

from typing import Any

import pytest

from core.jobs.kinds import JobKind
from core.jobs.models import Leased
from core.jobs.retried import RetriedKind
from core.wakeups import workers as wakeup

from .kinds import MAKERS


@pytest.fixture
def woken(monkeypatch) -> list[tuple[str, str]]:
    """The tasks that workers are woken for, with the queue, instead of a broker. Readers of events are none."""
    messages: list[tuple[str, str]] = []

    def publish(task: str, *, queue: str = "", **options: Any) -> None:
        if queue:
            messages.append((task, queue))

    monkeypatch.setattr(wakeup, "publish", publish)
    return messages


@pytest.fixture(params=MAKERS, ids=lambda kind: kind.name)
def kind(request) -> JobKind[Any]:
    return request.param


@pytest.fixture
def retried(kind) -> RetriedKind[Any]:
    """In a class of tests that are about kinds whose jobs end by a fault."""
    assert isinstance(kind, RetriedKind)
    return kind


@pytest.fixture
def waiting(kind, alice, oval, now, woken, settings) -> Leased:
    settings.TRAINING = settings.VIDEOS = True
    return MAKERS[kind](alice, oval, now)


@pytest.fixture
def claimed(kind, waiting, now) -> Leased:
    job = kind.claim(worker="first", now=now)
    assert job == waiting
    return job
