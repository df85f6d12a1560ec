"""Readers: each event once, in order, whatever is killed."""

from __future__ import annotations

from datetime import timedelta

import pytest

from core.events import Event, EventReader, follow, record, register_reader, tasks
from core.events.models import EventCursor
from core.events.reading import number_new, trim

from .conftest import BELL, FIRST, OTHER

pytestmark = pytest.mark.django_db


def ring(now, *numbers: int) -> None:
    for number in numbers:
        record(BELL, at=now, number=number)


def positions() -> list[int | None]:
    return list(Event.objects.order_by("pk").values_list("position", flat=True))


class TestFollowing:
    def test_a_reader_gets_each_event_of_its_kinds_once_in_order(self, ear, heard, now):
        ring(now, 1, 2)
        record(OTHER, at=now)
        ring(now, 3)
        assert follow("ear", now=now) == 3 and follow("ear", now=now) == 0
        ring(now, 4)
        assert follow("ear", now=now) == 1
        assert heard == [1, 2, 3, 4] and positions() == [1, 2, 3, 4, 5]

    def test_readers_progress_independently(self, ear, heard, now):
        ring(now, 1)
        follow("ear", now=now)
        late = []
        register_reader(EventReader("late", (BELL, FIRST), lambda event, now: late.append(event.kind) or 1))
        ring(now, 2)
        record(FIRST, at=now, subject="church", once="church")
        assert follow("late", now=now) == 3, "from the first that is kept"
        assert heard == [1] and late == [BELL.name, BELL.name, FIRST.name]

    def test_a_reader_that_raises_gets_the_event_again(self, ear, heard, now):
        ring(now, 1, 2, 3)

        def stumble(event: Event, now) -> int:
            Event.objects.create(kind="test.note", at=now)
            if event.data["number"] == 2:
                raise ZeroDivisionError
            return 1

        register_reader(EventReader("clumsy", (BELL,), stumble))
        for _ in range(2):
            with pytest.raises(ZeroDivisionError):
                follow("clumsy", now=now)
        assert EventCursor.objects.get(pk="clumsy").position == 1
        assert Event.objects.filter(kind="test.note").count() == 1, "what it wrote for the second is undone"
        assert follow("ear", now=now) == 3 and heard == [1, 2, 3], "the others go on"

    def test_reading_nothing_new_takes_no_lock(self, ear, now, django_assert_num_queries):
        ring(now, 1)
        follow("ear", now=now)
        with django_assert_num_queries(3) as looked:
            follow("ear", now=now)
        assert not [query["sql"] for query in looked if not query["sql"].startswith("SELECT")]

    def test_many_events_are_numbered_in_writing_order(self, ear, heard, now, monkeypatch):
        monkeypatch.setattr("core.events.reading.AT_ONCE", 3)
        ring(now, *range(8))
        assert number_new() == 8 and number_new() == 0
        assert positions() == list(range(1, 9))
        follow("ear", now=now)
        assert heard == list(range(8))

    def test_the_sweep_wakes_every_reader(self, ear, heard, now, monkeypatch):
        ring(now, 1)
        asked = []
        monkeypatch.setattr(tasks, "wake", asked.append)
        assert tasks.sweep() == 1 and asked == ["ear"]
        assert tasks.follow("ear") == 1 and heard == [1]


class TestTrimming:
    @pytest.fixture
    def old(self, settings):
        """A moment at which what is written now is too old to be kept."""
        from django.utils import timezone

        settings.EVENTS_KEPT_DAYS = 10
        return timezone.now() + timedelta(days=11)

    def test_old_read_events_are_trimmed_and_positions_never_reused(self, ear, now, old):
        ring(now, 1, 2)
        follow("ear", now=now)
        assert trim(now=old - timedelta(days=2)) == 0, "not old yet"
        assert trim(now=old) == 2 and trim(now=old) == 0
        ring(now, 3)
        assert follow("ear", now=now) == 1 and positions() == [3]

    def test_unread_events_are_kept_however_old(self, ear, heard, now, old):
        ring(now, 1)
        follow("ear", now=now)
        ring(now, 2)
        assert trim(now=old) == 1
        follow("ear", now=now)
        assert heard == [1, 2] and trim(now=old) == 1

    def test_a_reader_of_rare_events_does_not_retain_the_others(self, ear, now, old):
        for _ in range(5):
            record(OTHER, at=now)
        assert trim(now=old) == 5 and EventCursor.objects.get(pk="ear").position == 5

    def test_a_reader_that_never_read_retains_all_of_its_kinds(self, ear, now, old):
        record(OTHER, at=now)
        ring(now, 1)
        record(OTHER, at=now)
        assert trim(now=old) == 1 and list(Event.objects.values_list("kind", flat=True)) == [BELL.name, OTHER.name]

    def test_without_readers_events_are_trimmed_by_age(self, now, old):
        ring(now, 1)
        assert trim(now=now) == 0 and tasks.trim() == 0 and trim(now=old) == 1
