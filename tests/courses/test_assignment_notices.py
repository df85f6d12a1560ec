"""Notices of assignments: who gets them, once, and what they never name."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import translation

from accounts.models import Racer
from core import events
from courses.assignments.services import extend, make_submission_group
from courses.attempts.draws import complete_all_marks, draw_hidden_tracks, record_due_assignments
from courses.attempts.services import refund_attempt
from courses.notices import NOTICES
from league.models import Notice
from league.notices.sentences import sentence
from tests.courses.assignments import DAY, HOUR, a_group, a_part, an_assignment, finish_all, hand_in
from tests.factories import a_racer, a_track, laps
from tests.rows import track_row

pytestmark = pytest.mark.django_db
FAST = laps(9_000, 9_000, 9_000)


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


def noticed(racer: Racer) -> list[str]:
    """The kinds of a racer's notices, the earliest first."""
    return list(Notice.objects.filter(racer=racer).order_by("pk").values_list("kind", flat=True))


def texts(racer: Racer) -> list[str]:
    return [sentence(one) for one in Notice.objects.filter(racer=racer).order_by("pk")]


def follow(now) -> None:
    events.follow(NOTICES.name, now=now)


def test_students_get_a_published_assignment_once_and_teachers_none(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    an_assignment(group, now)
    for _ in range(2):
        follow(now)
    assert noticed(bob) == noticed(carol) == ["assigned"]
    assert noticed(alice) == noticed(a_racer()) == []
    assert "First" in texts(bob)[0] and "Course" in texts(bob)[0]


def test_a_draft_and_one_that_is_over_give_none(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    an_assignment(group, now, publish=False)
    an_assignment(group, now)
    follow(now + 2 * DAY)
    assert noticed(bob) == []


def test_a_day_before_the_deadline_only_those_without_an_attempt_are_reminded(alice, now):
    group, (early, late, extended, one, other) = a_group(alice, 5, now)
    assignment = an_assignment(group, now, due_at=now + 5 * DAY)
    make_submission_group(assignment=assignment, by=alice, name="Red", racers=[one, other], now=now)
    hand_in(assignment, early, now)
    hand_in(assignment, one, now)
    extend(assignment=assignment, racer=extended, by=alice, due_at=now + 9 * DAY, last_at=None, reason="ill", now=now)
    soon = now + 4 * DAY + HOUR
    assert record_due_assignments(now=now + 3 * DAY) == 0
    assert [record_due_assignments(now=soon), record_due_assignments(now=soon + HOUR)] == [1, 0]
    follow(soon)
    reminded = [racer for racer in (early, late, extended, one, other) if "due" in noticed(racer)]
    assert reminded == [late]


def test_one_that_opened_within_a_day_gives_no_reminder(alice, now):
    group, _students = a_group(alice, 1, now)
    an_assignment(group, now, due_at=now + HOUR)
    assert record_due_assignments(now=now) == 0


def test_complete_marks_are_told_again_only_where_they_changed(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now, last_at=now + 2 * DAY)
    attempt = hand_in(assignment, bob, now)
    finish_all(attempt, FAST, now)
    finish_all(hand_in(assignment, carol, now), FAST, now)
    over = now + 3 * DAY
    assert complete_all_marks(now=over) == 1
    follow(over)
    assert noticed(bob) == noticed(carol) == ["marked"] and "100" in texts(bob)[0]
    refund_attempt(attempt=attempt, by=alice, reason="wrong track", now=over + HOUR)
    assert complete_all_marks(now=over + HOUR) == 1
    follow(over + HOUR)
    assert noticed(bob) == ["marked", "given_back", "marked"] and noticed(carol) == ["marked"]


def test_no_notice_names_a_hidden_track(alice, now):
    secret = track_row("baja-turnpike")
    group, (bob,) = a_group(alice, 1, now)
    part = a_part(tracks=[(a_track(), "shown"), (secret, "candidate")], hidden_tracks=1)
    assignment = an_assignment(group, now, parts=[part], due_at=now + 2 * DAY)
    follow(now)
    finish_all(hand_in(assignment, bob, now), FAST, now)
    record_due_assignments(now=now + DAY + HOUR)
    follow(now + DAY + HOUR)
    draw_hidden_tracks(now=now + 2 * DAY + timedelta(seconds=1))
    follow(now + 2 * DAY + HOUR)
    params = " ".join(str(one.params) + one.path for one in Notice.objects.all())
    assert noticed(bob) == ["assigned"] and secret.slug not in params and secret.name not in params


def test_the_sentences_are_in_korean_too(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    an_assignment(group, now)
    follow(now)
    with translation.override("ko"):
        assert "마감" in texts(bob)[0]
