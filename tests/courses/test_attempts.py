"""Handing in: who, when, how often; what ends of runs write."""

from __future__ import annotations

from datetime import timedelta
from decimal import Decimal

import pytest

from courses.assignments.services import extend, make_submission_group
from courses.attempts import services
from courses.attempts.overview import handed_in_by, tasks_of
from courses.attempts.services import refund_attempt, submit_attempt
from courses.grading.members import unit_of
from courses.grading.services import deadline_of
from courses.models import Attempt, AttemptRun, Mark, RefundKind, RunState
from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from evaluation.running.queue.services import stop_evaluation
from evaluation.signals import evaluation_ended
from paddock.errors import PlatformFault, UserFault
from tests.courses.assignments import DAY, HOUR, a_group, an_assignment, finish_all, hand_in
from tests.factories import a_model, break_down, laps, outcome

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


def code(call, *arguments, **options) -> str:
    with pytest.raises(UserFault) as refused:
        call(*arguments, **options)
    return refused.value.code


def test_an_attempt_queues_a_run_and_its_end_writes_the_mark(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now)
    attempt = hand_in(assignment, bob, now)
    mark = Mark.objects.get(assignment=assignment, racer=bob)
    assert (mark.points, mark.is_complete, mark.attempt) == (0, False, attempt)
    finish_all(attempt, laps(9000, 9000, 9000, 9000, 9000), now)
    mark.refresh_from_db()
    assert (mark.points, mark.is_complete) == (Decimal(100), True)
    assert attempt.runs.get().state == RunState.FINISHED and len(attempt.runs.get().laps) == 5


def test_the_end_of_a_run_counts_once(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    attempt = hand_in(an_assignment(group, now), bob, now)
    finish_all(attempt, laps(9000), now)
    run = attempt.runs.get()
    evaluation_ended.send(sender=Evaluation, evaluation=run.evaluation, result=None, now=now + HOUR)
    again = AttemptRun.objects.get(pk=run.pk)
    assert (again.state, again.ended_at, len(again.laps)) == (RunState.FINISHED, now, 1)


def test_an_end_and_its_mark_stand_or_fall_together(alice, now, monkeypatch):
    group, (bob,) = a_group(alice, 1, now)
    attempt = hand_in(an_assignment(group, now), bob, now)

    def killed(**options):
        raise SystemExit

    with monkeypatch.context() as patch:
        patch.setattr(services, "recompute_marks", killed)
        with pytest.raises(SystemExit):
            finish_all(attempt, laps(9000, 9000, 9000), now)
    run = attempt.runs.select_related("evaluation").get()
    assert (run.state, run.laps, run.evaluation.is_final) == (RunState.WAITING, [], False)
    ended = {"pk": run.evaluation_id, "lease": run.evaluation.lease, "outcome": outcome(laps(9000, 9000, 9000))}
    assert [finish_evaluation(now=now, **ended) for _time in range(2)] == [True, False]
    assert Mark.objects.get().points == 100


def test_a_run_that_fails_by_the_car_counts(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, attempts_in_all=1)
    attempt = hand_in(assignment, bob, now)
    stop_evaluation(evaluation=attempt.runs.get().evaluation, now=now)
    assert attempt.runs.get().state == RunState.FAILED
    mark = Mark.objects.get()
    assert (mark.points, mark.is_complete, mark.parts[0]["why"]) == (0, True, "too_few_laps")
    assert code(hand_in, assignment, bob, now) == "attempts_used_up"


def test_what_fails_by_the_site_gives_the_attempt_back(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, attempts_in_all=1)
    attempt = hand_in(assignment, bob, now)
    break_down(attempt.runs.get().evaluation, PlatformFault("runner_died"), now)
    attempt.refresh_from_db()
    assert (attempt.refund_kind, attempt.refunded_at) == (RefundKind.PLATFORM, now)
    (task,) = tasks_of(bob, handed_in_by(bob), now)
    assert (task.used, task.left) == (0, 1)
    hand_in(assignment, bob, now)


def test_the_second_of_the_deadline_is_in_time(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now)
    hand_in(assignment, bob, assignment.due_at)
    late = assignment.due_at + timedelta(microseconds=1)
    assert code(hand_in, assignment, carol, late) == "attempt_too_late"
    assert Attempt.objects.count() == 1


def test_limits_in_all_and_a_day(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    day = now.replace(hour=12)
    assignment = an_assignment(group, day, due_at=day + 9 * DAY, attempts_a_day=2, attempts_in_all=3)
    hand_in(assignment, bob, day)
    hand_in(assignment, bob, day)
    assert code(hand_in, assignment, bob, day) == "attempts_of_day_used_up"
    hand_in(assignment, bob, day + DAY)
    assert code(hand_in, assignment, bob, day + 2 * DAY) == "attempts_used_up"
    refund_attempt(attempt=Attempt.objects.earliest("pk"), by=alice, reason="a broken track", now=day + 2 * DAY)
    assert hand_in(assignment, bob, day + 2 * DAY).number == 4


def test_the_same_car_twice_in_a_row_is_refused(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now)
    model = a_model(bob)
    submit_attempt(assignment=assignment, racer=bob, model=model, now=now)
    assert code(submit_attempt, assignment=assignment, racer=bob, model=model, now=now) == "attempt_already_submitted"
    hand_in(assignment, bob, now)
    submit_attempt(assignment=assignment, racer=bob, model=model, now=now)


def test_who_may_not_hand_in(alice, bob, now):
    group, (carol,) = a_group(alice, 1, now)
    draft = an_assignment(group, now, publish=False)
    assert code(hand_in, draft, carol, now) == "attempt_students_only"
    assignment = an_assignment(group, now)
    assert code(hand_in, assignment, bob, now) == "attempt_students_only"
    assert code(hand_in, assignment, alice, now) == "attempt_students_only"
    other = a_model(bob)
    assert code(submit_attempt, assignment=assignment, racer=carol, model=other, now=now) == "model_not_yours"
    assert code(hand_in, assignment, carol, now - 2 * HOUR) == "attempt_not_open_yet"


def test_an_extension_moves_one_students_deadline(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now)
    late = assignment.due_at + HOUR
    extend(assignment=assignment, racer=bob, by=alice, due_at=late, last_at=None, reason="ill", now=now)
    attempt = hand_in(assignment, bob, late)
    finish_all(attempt, laps(9000, 9000, 9000), late)
    mark = Mark.objects.get(racer=bob)
    assert (mark.points, mark.late_days) == (100, 0)
    assert code(hand_in, assignment, carol, late) == "attempt_too_late"


def test_an_extension_does_not_take_the_late_days_of_others_away(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, last_at=now + 5 * DAY, late_points_a_day=20)
    due = assignment.due_at + DAY
    extend(assignment=assignment, racer=bob, by=alice, due_at=due, last_at=None, reason="ill", now=now)
    assert deadline_of(assignment, unit_of(assignment, bob)) == (due, assignment.last_at)
    finish_all(hand_in(assignment, bob, due + HOUR), laps(9000, 9000, 9000), due + HOUR)
    assert (Mark.objects.get().points, Mark.objects.get().late_days) == (80, 1)


def test_a_submission_group_shares_attempts_and_marks(alice, now):
    group, (bob, carol, dave) = a_group(alice, 3, now)
    assignment = an_assignment(group, now, attempts_in_all=2)
    make_submission_group(assignment=assignment, by=alice, name="Red", racers=[bob, carol], now=now)
    first, second = hand_in(assignment, bob, now), hand_in(assignment, carol, now)
    assert (first.number, second.number) == (1, 2)
    assert code(hand_in, assignment, bob, now) == "attempts_used_up"
    finish_all(first, laps(9000, 9000, 9000), now)
    finish_all(second, laps(9000), now)
    assert {mark.racer_id: mark.points for mark in Mark.objects.all()} == {bob.pk: 100, carol.pk: 100}
    assert hand_in(assignment, dave, now).number == 1
