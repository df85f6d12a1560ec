"""What is made once for all is never older than the question."""

from __future__ import annotations

import threading
from datetime import timedelta
from types import SimpleNamespace

import pytest
from django.db import connection, transaction
from django.utils import timezone

from core.database.commit_cache import Unchanged, database_version, is_shared
from races.models import Race
from tests.factories import a_race

pytestmark = pytest.mark.django_db(transaction=True)
LONG = 3600.0


@pytest.fixture
def race() -> Race:
    return a_race(timezone.now())


def commit(race: Race) -> None:
    """Change something, as another program does."""
    race.opens_at -= timedelta(minutes=1)
    race.save()


def numbered(for_all: bool = True):
    """Values 1, 2, 3 as they are made."""
    made = iter(range(1, 100))
    return lambda: (next(made), for_all)


def test_the_version_of_the_database_changes_with_each_commit(race):
    first = database_version()
    assert database_version() == first
    commit(race)
    assert database_version() != first


def test_a_value_is_made_once_until_somebody_commits(race):
    values, make = Unchanged[int](10), numbered()
    assert [values.get("a", LONG, make) for _ in range(3)] == [1, 1, 1]
    assert values.get("b", LONG, make) == 2
    commit(race)
    assert [values.get(key, LONG, make) for key in "aab"] == [3, 3, 4]


def test_a_value_expires(race, monkeypatch):
    monkeypatch.setattr("core.database.commit_cache.SLOW_S", -1.0)  # else one that was slow to make lives longer
    values, make = Unchanged[int](10), numbered()
    assert [values.get("a", -1.0, make) for _ in range(2)] == [1, 2]


def test_a_value_that_is_slow_to_make_lives_longer(race, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("core.database.commit_cache.time", SimpleNamespace(monotonic=lambda: now[0]))
    values, make = Unchanged[int](10), numbered()

    def make_slowly():
        now[0] += 1.0
        return make()

    seen = []
    for pause_s in (0.0, 2.5, 1.0):  # it lives four times the second that it took
        now[0] += pause_s
        seen.append(values.get("a", 0.5, make_slowly))
    assert seen == [1, 1, 2]


def test_a_private_value_is_not_shared(race):
    values, make = Unchanged[int](10), numbered(for_all=False)
    assert [values.get("a", LONG, make) for _ in range(2)] == [1, 2]


def test_the_least_recently_used_value_makes_way(race):
    values, make = Unchanged[int](2), numbered()
    assert [values.get(key, LONG, make) for key in "abacab"] == [1, 2, 1, 3, 1, 4]


def test_a_failed_value_is_made_by_the_next_caller(race):
    values = Unchanged[int](2)

    def fails():
        raise RuntimeError

    with pytest.raises(RuntimeError):
        values.get("a", LONG, fails)
    assert values.get("a", LONG, numbered()) == 1


def test_a_waiting_caller_never_gets_a_value_begun_too_early(race):
    """Eight ask while the first value is made: that one is older than their question, the second is for all of them."""
    values, begun, go_on = Unchanged[int](2), threading.Event(), threading.Event()
    made: list[int] = []

    def make() -> tuple[int, bool]:
        made.append(len(made) + 1)
        begun.set()
        assert go_on.wait(20)
        with connection.cursor() as cursor:  # a commit while each is made
            cursor.execute("UPDATE races_race SET description = description || '.' WHERE id = %s", [race.pk])
        return made[-1], True

    found: list[int] = []

    def ask() -> None:
        found.append(values.get("a", LONG, make))
        connection.close()

    first = threading.Thread(target=ask)
    first.start()
    assert begun.wait(20)
    others = [threading.Thread(target=ask) for _ in range(8)]
    for other in others:
        other.start()
    _all_wait(others)
    go_on.set()
    for thread in (first, *others):
        thread.join(20)
    assert made == [1, 2]
    assert sorted(found) == [1] + [2] * 8


def _all_wait(threads: list[threading.Thread]) -> None:
    """Return once each thread has asked: they stand at the lock, where nothing but its release moves them."""
    threading.Event().wait(0.3)
    assert all(thread.is_alive() for thread in threads)


def test_nothing_is_shared_inside_a_transaction(race):
    assert is_shared()
    with transaction.atomic():
        assert not is_shared()
