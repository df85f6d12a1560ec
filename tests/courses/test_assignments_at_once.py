"""Two tabs, two workers, a teacher and a student at the same moment: on SQLite here, on PostgreSQL below."""

from __future__ import annotations

import pytest

from courses.attempts.draws import complete_all_marks, draw_hidden_tracks
from courses.attempts.services import refund_attempt, submit_attempt
from courses.models import Assignment, Attempt, AttemptRun, Extension, Mark
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from paddock.errors import PlatformFault
from tests.courses.assignments import DAY, HOUR, a_group, an_assignment, finish_all, hand_in
from tests.courses.test_hidden_tracks import hidden
from tests.factories import a_model, break_down, laps, outcome, start
from tests.races.test_concurrency import at_once

pytestmark = pytest.mark.django_db(transaction=True)

FAST = laps(9_000, 9_000, 9_000)


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


def test_of_six_attempts_sent_at_once_the_limit_holds(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, attempts_in_all=2)
    models = [a_model(bob) for _number in range(6)]
    answers = at_once(
        [
            lambda model=model: submit_attempt(
                assignment=Assignment.objects.get(pk=assignment.pk), racer=bob, model=model, now=now
            )
            for model in models
        ]
    )
    assert sorted(str(one) for one in answers if not isinstance(one, Attempt)) == ["attempts_used_up"] * 4, answers
    assert sorted(Attempt.objects.values_list("number", flat=True)) == [1, 2]
    assert Evaluation.objects.count() == AttemptRun.objects.count() == 2


def test_an_attempt_is_given_back_once(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    attempt = hand_in(an_assignment(group, now, attempts_in_all=1), bob, now)

    def refund() -> Attempt:
        mine = Attempt.objects.select_related("assignment__group").get(pk=attempt.pk)
        return refund_attempt(attempt=mine, by=alice, reason="a broken track", now=now)

    answers = at_once([refund] * 3)
    assert sorted(str(one) for one in answers if not isinstance(one, Attempt)) == ["attempt_refunded_already"] * 2
    hand_in(attempt.assignment, bob, now)


def test_a_fault_of_the_site_and_a_teacher_give_back_once(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    attempt = hand_in(an_assignment(group, now), bob, now)
    waiting = attempt.runs.get().evaluation

    def refund() -> Attempt:
        mine = Attempt.objects.select_related("assignment__group").get(pk=attempt.pk)
        return refund_attempt(attempt=mine, by=alice, reason="a broken track", now=now)

    answers = at_once([refund, lambda: break_down(waiting, PlatformFault("runner_died"), now)])
    attempt.refresh_from_db()
    assert attempt.refunded_at == now and attempt.refund_kind in ("teacher", "platform"), answers
    assert not any(isinstance(one, BaseException) for one in answers), answers
    assert Extension.objects.count() <= 1 and Mark.objects.get().attempt is None


def test_hidden_tracks_are_drawn_once_while_runs_end_and_a_student_hands_in(alice, now):
    group, students = a_group(alice, 3, now)
    assignment = an_assignment(group, now, last_at=now + 9 * DAY, **hidden(now))
    ends = []
    for racer in students[:2]:
        running = start(hand_in(assignment, racer, now).runs.get().evaluation, now)
        ends.append({"pk": running.pk, "lease": running.lease, "outcome": outcome(FAST)})
    after, late = assignment.due_at + HOUR, a_model(students[2])
    answers = at_once(
        [
            *([lambda: draw_hidden_tracks(now=after)] * 2),
            *(lambda one=one: finish_evaluation(now=after, **one) for one in ends),
            lambda: submit_attempt(
                assignment=Assignment.objects.get(pk=assignment.pk), racer=students[2], model=late, now=after
            ),
        ]
    )
    assert sorted(answers[:2]) == [0, 1] and answers[2:4] == [True, True], answers
    assert [one.runs.count() for one in Attempt.objects.all()] == [2, 2, 2]
    for attempt in Attempt.objects.all():
        finish_all(attempt, FAST, after)
    assert [*Mark.objects.values_list("points", "is_complete")] == [(100, True)] * 3
    over = assignment.last_at + HOUR
    assert sorted(at_once([lambda: complete_all_marks(now=over)] * 2)) == [0, 1]


@pytest.mark.postgres
@pytest.mark.xdist_group("workers")
def test_the_tests_of_this_file_pass_on_postgresql_too(again_on_postgresql):
    again_on_postgresql(__file__, "-m", "not postgres")
