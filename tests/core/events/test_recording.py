"""Writing down what happened."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import IntegrityError, connection, transaction
from django.utils import timezone

from core.events import Event, EventKind, record, record_all, register, written

from .conftest import BELL, FIRST, OTHER

pytestmark = pytest.mark.django_db


def test_an_event_is_rolled_back_with_its_transaction(now):
    record(BELL, at=now, number=1)
    with pytest.raises(ZeroDivisionError), transaction.atomic():
        record(BELL, at=now, number=2)
        raise ZeroDivisionError
    event = Event.objects.get()
    assert (event.kind, event.at, event.data, event.position) == ("test.rang", now, {"number": 1}, None)


def test_an_events_time_is_the_databases(now):
    record(BELL, at=now, number=1)
    assert abs(Event.objects.get().recorded_at - timezone.now()) < timedelta(minutes=1)


def test_a_one_time_event_is_written_once(now):
    assert record(FIRST, at=now, subject="church", once="church")
    assert not record(FIRST, at=now + timedelta(days=1), subject="church", once="church")
    assert record(FIRST, at=now, subject="school", once="school")
    assert list(Event.objects.order_by("pk").values_list("subject", "at")) == [("church", now), ("school", now)]
    with pytest.raises(IntegrityError), transaction.atomic():
        Event.objects.create(kind=FIRST.name, at=now, once="church")


def test_many_events_are_written_in_few_queries(now, django_assert_max_num_queries):
    with django_assert_max_num_queries(4):
        assert record_all(written(BELL, at=now, number=number) for number in range(100)) == 100
    assert record_all([]) == 0 and Event.objects.count() == 100


@pytest.mark.parametrize(
    ("kind", "what"),
    [
        (BELL, {}),
        (BELL, {"number": 1, "colour": "red"}),
        (BELL, {"number": 1, "race": 1}),
        (BELL, {"number": 1, "once": "x"}),
        (FIRST, {"subject": "church"}),
        (FIRST, {"once": "church"}),
        (EventKind("test.unheard", "of which nobody has heard"), {}),
    ],
)
def test_an_event_that_does_not_fit_its_kind_is_an_error(now, kind, what):
    with pytest.raises(TypeError):
        record(kind, at=now, **what)
    assert not Event.objects.exists()


def test_duplicate_kinds_and_unknown_columns_are_refused():
    assert register(BELL) is BELL
    with pytest.raises(ValueError):
        register(EventKind(BELL.name, "something else"))
    with pytest.raises(ValueError):
        register(EventKind("test.new", "something new", names=("weather",)))


class TestWakingUp:
    def test_readers_of_a_kind_are_woken_once_after_the_commit(
        self, ear, woken, now, django_capture_on_commit_callbacks
    ):
        with django_capture_on_commit_callbacks(execute=True):
            for number in range(3):
                record(BELL, at=now, number=number)
            record(OTHER, at=now)
            assert woken == []
        assert woken == ["ear"]

    def test_unread_kinds_and_repeated_events_wake_nobody(self, ear, woken, now, django_capture_on_commit_callbacks):
        with django_capture_on_commit_callbacks(execute=True):
            record(OTHER, at=now)
        assert woken == []

    def test_rolling_back_a_savepoint_cancels_only_its_own_wake_up(
        self, ear, woken, now, django_capture_on_commit_callbacks
    ):
        with django_capture_on_commit_callbacks(execute=True):
            with pytest.raises(ZeroDivisionError), transaction.atomic():
                record(BELL, at=now, number=1)
                raise ZeroDivisionError
            assert not connection.run_on_commit
            record(BELL, at=now, number=2)
        assert woken == ["ear"]
