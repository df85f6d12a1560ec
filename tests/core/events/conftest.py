"""A kind of event and a reader that only these tests know."""

from __future__ import annotations

import pytest

from core.events import KINDS, Event, EventKind, EventReader, reading, register_reader, waking
from core.events import register as register_kind

BELL = EventKind("test.rang", "a bell has rung", data=("number",))
FIRST = EventKind("test.first", "a bell has rung for the first time", names=("subject",), once="bell")
OTHER = EventKind("test.other", "something that nobody reads")


@pytest.fixture(autouse=True)
def kinds_of_these_tests(monkeypatch):
    """Known during these tests only; and no other reader looks on."""
    before = dict(KINDS)
    for kind in (BELL, FIRST, OTHER):
        register_kind(kind)
    monkeypatch.setattr(reading, "READERS", {})
    monkeypatch.setattr(waking, "_INTERESTED", {})
    yield
    KINDS.clear()
    KINDS.update(before)


@pytest.fixture
def heard() -> list[int]:
    """What the reader ``ear`` has heard."""
    return []


@pytest.fixture
def ear(heard) -> EventReader:
    def handle(event: Event, now) -> int:
        heard.append(event.data["number"])
        return 1

    return register_reader(EventReader("ear", (BELL,), handle))
