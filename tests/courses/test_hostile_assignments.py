"""Assignments under values that no form sends, and when two things happen at once."""

from __future__ import annotations

from decimal import Decimal

import pytest

from accounts.leaving.services import delete_account
from courses.assignments.forms import local_moment
from courses.assignments.services import change_assignment, extend, make_submission_group
from courses.attempts import services
from courses.attempts.draws import complete_all_marks, draw_hidden_tracks
from courses.attempts.overview import handed_in_by, tasks_of
from courses.attempts.selectors import refusal_of
from courses.grading.members import unit_of
from courses.grading.services import deadline_of
from courses.marks.services import apply_regrade, propose_regrade
from courses.models import Assignment, Attempt, AttemptRun, Extension, Mark
from evaluation.models import Evaluation
from evaluation.running.queue.order import URGENT
from paddock.errors import PlatformFault, UserFault
from races.errors import RaceRefused
from tests.clients import logged_in
from tests.courses.assignments import DAY, HOUR, a_group, a_part, an_assignment, finish_all, hand_in
from tests.courses.test_hidden_tracks import hidden
from tests.factories import a_model, break_down, laps

pytestmark = pytest.mark.django_db

FAST, SLOW = laps(9_000, 9_000, 9_000), laps(12_000, 12_000, 12_000)
BY_TIME = {"pass_rule": "thresholds", "points": "10", "title": "Times", "tracks": [{"track": "oval"}]}


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


@pytest.mark.parametrize("sent", [[], {}, ["best"], 1, None])
def test_a_choice_of_another_type_is_refused(alice, now, sent):
    assignment = an_assignment(a_group(alice, 1, now)[0], now)
    times = [{"at_most_ms": 9000, "points": 1}]
    answer = logged_in(alice).patch(
        f"/api/v1/assignments/{assignment.public_id}/",
        {"parts": [{**BY_TIME, "pass_params": {"thresholds": times, "by": sent}}]},
        content_type="application/json",
    )
    assert (answer.status_code, answer.json()["code"]) == (400, "assignment_value_choice")


@pytest.mark.parametrize(
    ("sent", "kept"), [("1e-99999", "0"), ("0e-99999", "0"), ("0e99999", "0"), ("1e1", "10"), ("0.125", "0.12")]
)
def test_points_of_thresholds_are_kept_in_cents(alice, now, sent, kept):
    """A number of a hundred thousand digits would stand on each page of the assignment."""
    assignment = an_assignment(a_group(alice, 1, now)[0], now)
    times = [{"at_most_ms": 9000, "points": sent}]
    answer = logged_in(alice).patch(
        f"/api/v1/assignments/{assignment.public_id}/",
        {"parts": [{**BY_TIME, "pass_params": {"thresholds": times}}]},
        content_type="application/json",
    )
    assert answer.status_code == 200 and len(answer.content) < 5000
    assert assignment.parts.get().pass_params["thresholds"] == [{"at_most_ms": 9000, "points": kept}]


@pytest.mark.parametrize("name", ["opens_at", "due_at", "last_at"])
@pytest.mark.parametrize("year", [1, 1999, 3000, 9999])
def test_a_moment_that_no_clock_shows_is_refused(alice, now, name, year):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, time_zone="Asia/Seoul")
    far = now.replace(year=year)
    with pytest.raises(RaceRefused) as refused:
        change_assignment(assignment=assignment, by=alice, now=now, **{name: far})
    assert name in refused.value.errors.error_dict
    if name != "opens_at":
        times = {"due_at": now + 2 * DAY, "last_at": None, name: far}
        with pytest.raises(RaceRefused) as refused:
            extend(assignment=assignment, racer=bob, by=alice, reason="", now=now, **times)
        assert name in refused.value.errors.error_dict


@pytest.mark.parametrize("year", [1, 9999])
def test_a_typed_moment_that_no_clock_shows_is_an_error_of_its_field(alice, now, year):
    assignment = an_assignment(a_group(alice, 1, now)[0], now, time_zone="Asia/Seoul")
    typed = {"racer": "", "due_at": f"{year:04}-01-01T00:00", "reason": "x", "do": "extend"}
    answer = logged_in(alice).post(f"/assignments/{assignment.public_id}/exceptions/", typed)
    assert answer.status_code == 422 and "due_at" in answer.context["extension"].errors
    assert local_moment(now.replace(tzinfo=None), now.tzinfo) == now


def test_an_extension_leaves_the_late_days_in_the_list_too(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, last_at=now + 5 * DAY)
    due = assignment.due_at + DAY
    extend(assignment=assignment, racer=bob, by=alice, due_at=due, last_at=None, reason="ill", now=now)
    (task,) = tasks_of(bob, handed_in_by(bob), due + HOUR)
    unit = unit_of(assignment, bob)
    assert (task.due_at, task.last_at) == deadline_of(assignment, unit)
    assert (task.state, refusal_of(assignment, unit, due + HOUR)) == ("late", None)


def test_a_run_that_ends_during_a_regrade_is_marked_by_the_new_rules(alice, now, monkeypatch):
    group, (bob, carol) = a_group(alice, 2, now)
    rule = {"pass_rule": "best_lap", "pass_params": {"at_most_ms": 10_000}}
    assignment = an_assignment(group, now, parts=[a_part(**rule)])
    finish_all(hand_in(assignment, carol, now), SLOW, now)
    attempt = hand_in(assignment, bob, now)
    change_assignment(
        assignment=assignment, by=alice, now=now, parts=[a_part(**rule | {"pass_params": {"at_most_ms": 13_000}})]
    )
    regrade = propose_regrade(assignment=assignment, by=alice, reason="easier", now=now)
    held = services.hold_units

    def regraded_meanwhile(units) -> None:
        monkeypatch.setattr(services, "hold_units", held)
        apply_regrade(assignment=Assignment.objects.get(), regrade=regrade, by=alice, now=now)
        held(units)

    monkeypatch.setattr(services, "hold_units", regraded_meanwhile)
    finish_all(attempt, SLOW, now)
    marks = Mark.objects.order_by("pk").values_list("racer", "points", "rules_version")
    assert {*marks} == {(bob.pk, 100, 2), (carol.pk, 100, 2)}


def test_attempts_that_count_since_a_regrade_drive_the_drawn_tracks(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, counts="last", **hidden(now))
    for number in range(2):
        finish_all(hand_in(assignment, bob, now + number * HOUR), FAST, now + number * HOUR)
    after = assignment.due_at + HOUR
    draw_hidden_tracks(now=after)
    first, last = Attempt.objects.order_by("number")
    finish_all(last, SLOW[:1], after)
    complete_all_marks(now=after)
    change_assignment(assignment=assignment, by=alice, now=after, counts="best")
    if Assignment.objects.get().awaits_regrade:
        regrade = propose_regrade(assignment=assignment, by=alice, reason="the best counts", now=after)
        apply_regrade(assignment=assignment, regrade=regrade, by=alice, now=after)
    assert complete_all_marks(now=after) == 0 and first.runs.count() == 2
    finish_all(first, FAST, after)
    assert complete_all_marks(now=after) == 1
    assert Mark.objects.values_list("points", "is_complete", "attempt").get() == (100, True, first.pk)


def test_the_run_of_a_submission_group_stays_when_its_sender_leaves(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now)
    make_submission_group(assignment=assignment, by=alice, name="Red", racers=[bob, carol], now=now)
    attempt = hand_in(assignment, bob, now)
    delete_account(racer=bob, by=bob, now=now)
    assert Evaluation.objects.get().owner == carol
    finish_all(attempt, FAST, now)
    assert AttemptRun.objects.get().state == "finished"
    assert Mark.objects.values_list("racer", "points", "is_complete").get() == (carol.pk, Decimal(100), True)


def test_nobody_fills_the_queue_with_attempts(alice, now):
    group, (bob, carol) = a_group(alice, 2, now)
    assignment = an_assignment(group, now, last_at=now + 9 * DAY)
    for _number in range(services.MOST_WAITING):
        attempt = hand_in(assignment, bob, now)
        services.add_reference(assignment=assignment, by=alice, label="Teacher", model=a_model(alice), now=now)
    with pytest.raises(UserFault, match="wait for their runs"):
        hand_in(assignment, bob, now)
    with pytest.raises(UserFault, match="wait for their runs"):
        services.add_reference(assignment=assignment, by=alice, label="Teacher", model=a_model(alice), now=now)
    hand_in(assignment, carol, now)
    finish_all(attempt, FAST, now)
    hand_in(assignment, bob, now)


def test_only_attempts_in_time_go_before_others_in_the_last_hour(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, due_at=now + HOUR / 2, last_at=now + 9 * DAY)
    services.add_reference(assignment=assignment, by=alice, label="Teacher", model=a_model(alice), now=now)
    hand_in(assignment, bob, now)
    hand_in(assignment, bob, now + HOUR)
    hurries = [run.evaluation.priority == URGENT for run in AttemptRun.objects.order_by("pk")]
    assert hurries == [False, True, False]


def test_a_group_of_others_is_not_told_from_none(alice, bob, now):
    group, _students = a_group(alice, 1, now)
    sent = {"title": "x", "opens_at": now, "due_at": now + DAY}
    answers = [
        logged_in(bob).post("/api/v1/assignments/", {**sent, "group": slug}, content_type="application/json")
        for slug in (group.slug, "no-such-group")
    ]
    assert [one.status_code for one in answers] == [403, 403] and answers[0].content == answers[1].content


def test_a_late_attempt_that_the_site_failed_may_be_repeated_late(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, last_at=now + 2 * DAY, late_points_a_day=10)
    attempt = hand_in(assignment, bob, assignment.last_at)
    over = assignment.last_at + HOUR
    break_down(attempt.runs.get().evaluation, PlatformFault("runner_died"), over)
    unit = unit_of(assignment, bob)
    assert refusal_of(assignment, unit, over) is None
    assert deadline_of(assignment, unit) == (assignment.due_at, over + DAY)
    (task,) = tasks_of(bob, handed_in_by(bob), over)
    assert (task.state, task.last_at) == ("late", over + DAY)
    finish_all(hand_in(assignment, bob, over), FAST, over)
    assert Mark.objects.values_list("points", "late_days").get() == (80, 2)


def test_a_fault_of_the_site_keeps_a_teachers_reason(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now)
    due = assignment.due_at + HOUR
    extend(assignment=assignment, racer=bob, by=alice, due_at=due, last_at=None, reason="ill", now=now)
    attempt = hand_in(assignment, bob, due)
    break_down(attempt.runs.get().evaluation, PlatformFault("runner_died"), due + HOUR)
    extension = Extension.objects.get()
    assert (extension.due_at, extension.reason, extension.granted_by) == (due + HOUR + DAY, "ill", alice)
