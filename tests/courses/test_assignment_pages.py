"""The pages of assignments: what teachers and students see and do there."""

from __future__ import annotations

import pytest
from django.core.cache import cache

from tests.clients import logged_in
from tests.courses.assignments import a_group, an_assignment, finish_all, hand_in
from tests.factories import laps

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _fresh(wakes) -> None:
    cache.clear()


@pytest.fixture
def group(alice, now):
    return a_group(alice, 2, now)


def text(client, path: str, status: int = 200) -> str:
    answer = client.get(path)
    assert answer.status_code == status, path
    return answer.content.decode()


PAGES = ("", "edit/", "parts/1/", "exceptions/", "marks/", "regrade/", "log/")


def test_a_teacher_reads_every_page(group, alice, now):
    made = an_assignment(group[0], now)
    client = logged_in(alice)
    for page in PAGES:
        assert "First" in text(client, f"/assignments/{made.public_id}/{page}")
    assert "First" in text(client, "/assignments/")


def test_a_student_sees_what_is_due_passed_and_left(group, alice, now, set_clock):
    set_clock(now)
    room, (kim, _ann) = group
    made = an_assignment(room, now, attempts_in_all=3, attempts_a_day=2, time_zone="Europe/Berlin")
    client = logged_in(kim)
    page = text(client, "/assignments/")
    assert "First" in page and "in 24 hours, Monday 16 November 13:00 Berlin" in page
    assert "3 of 3" in page and "today 2 of 2" in page and "0 of 1" in page
    attempt = hand_in(made, kim, now)
    finish_all(attempt, laps(*[9_000] * 5), now)
    page = text(client, "/assignments/")
    assert "2 of 3" in page and "today 1 of 2" in page and "1 of 1" in page and "100" in page
    page = text(client, made.get_absolute_url())
    assert "5 laps in a row" in page and "/replay/" in page and "Attempt 1" in page
