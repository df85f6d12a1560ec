"""Writers and readers at the same moment: nothing is missed and nothing is done twice.

On SQLite here, and once more on PostgreSQL, where transactions really run side by side and ids are not in the order of
their commits.
"""

from __future__ import annotations

from threading import Event

import pytest
from django.db import connection, transaction

from core.events import Event as Happening
from core.events import EventReader, follow, record, register_reader
from core.events.models import EventCursor
from core.events.reading import number_new
from tests.races.test_concurrency import at_once

from .conftest import BELL, FIRST

pytestmark = pytest.mark.django_db(transaction=True)
WRITERS, EACH = 4, 15


def note(event: Happening, now) -> int:
    """What a reader writes: a row, so that a second time would be seen."""
    EventCursor.objects.create(pk=f"heard {event.data['number']}")
    return 1


def test_concurrent_readers_and_writers_lose_and_repeat_nothing(now):
    register_reader(EventReader("ear", (BELL,), note))
    done = Event()

    def write(writer: int) -> None:
        for number in range(EACH):
            with transaction.atomic():
                record(BELL, at=now, number=writer * EACH + number)

    def listen() -> int:
        told = 0
        while not done.is_set() or number_new() or Happening.objects.filter(position__gt=_read()).exists():
            told += follow("ear", now=now)
        return told

    def write_all() -> None:
        answers = at_once([lambda writer=writer: write(writer) for writer in range(WRITERS)])
        done.set()
        assert answers == [None] * WRITERS, answers

    answers = at_once([write_all, listen, listen])
    assert not [one for one in answers if isinstance(one, BaseException | str)], answers
    assert sum(answers[1:]) == WRITERS * EACH
    assert EventCursor.objects.filter(pk__startswith="heard ").count() == WRITERS * EACH
    positions = sorted(Happening.objects.values_list("position", flat=True))
    assert positions == list(range(1, WRITERS * EACH + 1))


def test_a_one_time_event_is_written_once_by_concurrent_writers(now):
    answers = at_once([lambda: record(FIRST, at=now, subject="church", once="church") for _ in range(6)])
    assert not [one for one in answers if isinstance(one, BaseException | str)], answers
    assert Happening.objects.count() == 1


def test_an_event_committed_late_is_not_missed(now):
    if connection.vendor != "postgresql":
        pytest.skip("SQLite has one writer at a time")
    register_reader(EventReader("ear", (BELL,), note))
    written, read = Event(), Event()

    def slow() -> None:
        with transaction.atomic():
            record(BELL, at=now, number=1)
            written.set()
            assert read.wait(timeout=30)

    def quick() -> list[int]:
        assert written.wait(timeout=30)
        record(BELL, at=now, number=2)
        told = [follow("ear", now=now)]
        read.set()
        return told

    answers = at_once([slow, quick])
    assert answers == [None, [1]], "the later one is read while the earlier one is still being written"
    assert follow("ear", now=now) == 1
    assert list(Happening.objects.order_by("pk").values_list("data__number", "position")) == [(1, 2), (2, 1)]


@pytest.mark.postgres
@pytest.mark.soak
@pytest.mark.django_db(transaction=False)
def test_the_same_holds_on_postgresql(again_on_postgresql):
    again_on_postgresql("tests/core/events")


def _read() -> int:
    return EventCursor.objects.filter(pk="ear").values_list("position", flat=True).first() or 0
