"""Making and changing assignments; copies; tracks in use; classes, groups and accounts that go."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import timezone

from accounts.class_accounts.services import add_learners, make_class
from accounts.groups.services import delete_group
from accounts.leaving.services import delete_account
from accounts.models import GroupMember, Racer
from courses.assignments.services import (
    change_assignment,
    copy_assignments,
    delete_assignment,
    make_assignment,
    make_submission_group,
    publish_assignment,
)
from courses.classes.deletion import delete_class
from courses.models import Assignment, Attempt, AttemptRun, Mark
from evaluation.models import Evaluation, TrainedModel
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from races.errors import RaceRefused
from tests.courses.assignments import DAY, HOUR, a_group, a_part, an_assignment, finish_all, hand_in
from tests.factories import a_track, laps
from tests.rows import track_row
from tracks.services import delete_track

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _no_broker(wakes) -> None:
    """Attempts send wake-ups; no test here needs a worker to take them."""


def problem(call, **options) -> tuple[str, str]:
    """The field and the code of a refusal."""
    with pytest.raises(RaceRefused) as refused:
        call(**options)
    ((field, (error, *_others)),) = refused.value.errors.error_dict.items()
    return field, error.code


@pytest.mark.parametrize(
    "fields, expected",
    [
        ({"due_at": timedelta(hours=-2)}, ("due_at", "assignment_closes_before_opening")),
        ({"last_at": timedelta(hours=1)}, ("last_at", "assignment_last_before_due")),
        ({"time_zone": "Mars/Base"}, ("time_zone", "assignment_time_zone")),
        ({"counts": "first_k"}, ("first_k", "assignment_first_k")),
        ({"first_k": 3}, ("first_k", "assignment_first_k")),
        ({"attempts_a_day": 0}, ("attempts_a_day", "min_value")),
        ({"title": "a\u202eb"}, ("title", "text_character")),
    ],
)
def test_a_wrong_field_is_named(alice, now, fields, expected):
    group, _students = a_group(alice, 0, now)
    values = {name: now + value if isinstance(value, timedelta) else value for name, value in fields.items()}
    values = {"title": "x", "opens_at": now - HOUR, "due_at": now + DAY} | values
    assert problem(make_assignment, group=group, by=alice, now=now, **values) == expected
    assert not Assignment.objects.exists()


@pytest.mark.parametrize(
    "part, code",
    [
        ({"tracks": []}, "assignment_no_tracks"),
        ({"pass_rule": "luck"}, "assignment_pass_rule"),
        ({"pass_params": {"laps": 0}}, "assignment_value"),
        ({"pass_params": {"turns": 3}}, "assignment_value_name"),
        ({"pass_params": {"laps": 6}}, "assignment_laps"),
        ({"rules": {"laps": 99}}, "max_value"),
        ({"rules": {"wheels": 3}}, "assignment_rules"),
        ({"rules": {"race_type": "head_to_head"}}, "race_needs_opponents"),
        ({"points": 0}, "min_value"),
        ({"hidden_tracks": 1}, "assignment_candidates"),
    ],
)
def test_a_wrong_part_is_refused(alice, now, part, code):
    group, _students = a_group(alice, 0, now)
    values = {"title": "x", "opens_at": now - HOUR, "due_at": now + DAY, "parts": [a_part(**part)]}
    with pytest.raises(RaceRefused) as refused:
        make_assignment(group=group, by=alice, now=now, **values)
    assert [(name, error.code) for name, (error, *_) in refused.value.errors.error_dict.items()] == [("parts", code)]
    assert not Assignment.objects.exists()


def test_parts_share_a_limit_of_tracks(alice, now):
    """Each track of each part is a run of every attempt."""
    group, _students = a_group(alice, 0, now)
    tracks = [track_row(track.slug) for track in CATALOGUE if not track.is_open and track.slug != "oval"][:20]
    full = a_part(tracks=[(track, "shown") for track in tracks])
    assert an_assignment(group, now, parts=[full, full]).parts.count() == 2
    values = {"title": "x", "opens_at": now - HOUR, "due_at": now + DAY, "parts": [full, full, a_part()]}
    with pytest.raises(RaceRefused) as refused:
        make_assignment(group=group, by=alice, now=now, **values)
    (error,) = refused.value.errors.error_dict["parts"]
    assert error.code == "assignment_too_many_tracks_in_all"


def test_obstacles_and_bots_are_driven_as_asked(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    boxes = {"race_type": "object_avoidance", "laps": 5, "random_boxes": 3, "seed": 7}
    bots = {"race_type": "head_to_head", "laps": 5, "bots": 2}
    assignment = an_assignment(group, now, parts=[a_part(), a_part(rules=boxes), a_part(rules=bots)])
    attempt = hand_in(assignment, bob, now)
    driven = [run.evaluation.spec["rules"] for run in attempt.runs.select_related("evaluation")]
    assert [one["race_type"] for one in driven] == ["time_trial", "object_avoidance", "head_to_head"]
    assert (driven[1]["random_boxes"], driven[1]["seed"], driven[2]["bots"]) == (3, 7, 2)


def test_what_is_driven_stays_after_the_first_attempt(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now)
    hand_in(assignment, bob, now)
    other = track_row(next(track.slug for track in CATALOGUE if track.slug != "oval"))
    for parts in ([a_part(tracks=[(other, "shown")])], [a_part(rules={"laps": 7})], [a_part(), a_part()]):
        field, code = problem(change_assignment, assignment=assignment, by=alice, now=now, parts=parts)
        assert (field, code) == ("parts", "assignment_has_begun")
    change_assignment(assignment=assignment, by=alice, now=now, parts=[a_part(title="Renamed", points=50)])
    assert assignment.parts.get().title == "Renamed"


def test_an_assignment_without_parts_is_not_published(alice, now):
    group, _students = a_group(alice, 0, now)
    draft = an_assignment(group, now, publish=False, parts=[])
    with pytest.raises(UserFault) as refused:
        publish_assignment(assignment=draft, by=alice, now=now)
    assert refused.value.code == "assignment_no_parts"


def test_a_copy_has_tasks_without_students(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now, attempts_a_day=3, late_points_a_day=20, last_at=now + 9 * DAY)
    hand_in(assignment, bob, now)
    next_term, _students = a_group(alice, 0, now, "Next")
    shift = timedelta(days=182)
    (copy,) = copy_assignments(from_group=group, to_group=next_term, by=alice, now=now, shift=shift)
    assert (copy.due_at, copy.last_at) == (assignment.due_at + shift, assignment.last_at + shift)
    assert (copy.published_at, copy.attempts.count(), copy.draw_seed == assignment.draw_seed) == (None, 0, False)
    part, source = copy.parts.get(), assignment.parts.get()
    assert (part.rules, part.pass_params, part.points) == (source.rules, source.pass_params, source.points)


def test_a_track_in_use_cannot_be_removed(alice, now):
    group, _students = a_group(alice, 0, now)
    an_assignment(group, now)
    with pytest.raises(UserFault) as refused:
        delete_track(track=a_track())
    assert refused.value.code == "track_in_use" and a_track().pk


def test_a_student_in_two_groups_has_a_mark_in_each(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    other, _students = a_group(alice, 0, now, "Other")
    GroupMember.objects.create(group=other, racer=bob, asked_at=now, confirmed_at=now, confirmed_by=alice)
    first = an_assignment(group, now, attempts_in_all=1)
    second = an_assignment(other, now, attempts_in_all=1)
    finish_all(hand_in(first, bob, now), laps(9_000, 9_000, 9_000), now)
    finish_all(hand_in(second, bob, now), laps(9_000), now)
    assert [mark.points for mark in Mark.objects.order_by("assignment")] == [100, 0]


def test_deadlines_hold_in_two_time_zones(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    day = now.replace(hour=23, minute=30)  # 08:30 of the next day in Seoul
    seoul = an_assignment(group, day, time_zone="Asia/Seoul", due_at=day + 3 * DAY, attempts_a_day=1)
    utc = an_assignment(group, day, due_at=day + 3 * DAY, attempts_a_day=1)
    for assignment in (seoul, utc):
        hand_in(assignment, bob, day)
    later = day + HOUR
    hand_in(utc, bob, later)
    with pytest.raises(UserFault) as refused:
        hand_in(seoul, bob, later)
    assert refused.value.code == "attempts_of_day_used_up"


def test_a_deleted_assignment_leaves_no_runs(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    assignment = an_assignment(group, now)
    finish_all(hand_in(assignment, bob, now), laps(9_000), now)
    hand_in(assignment, bob, now)
    delete_assignment(assignment=assignment, by=alice)
    assert not (Evaluation.objects.exists() or Attempt.objects.exists() or Mark.objects.exists())
    assert TrainedModel.objects.filter(owner=bob).count() == 2


def test_a_group_goes_with_its_open_assignment(alice, now):
    group, (bob,) = a_group(alice, 1, now)
    finish_all(hand_in(an_assignment(group, now), bob, now), laps(9_000), now)
    delete_group(group=group, by=alice)
    assert not (Assignment.objects.exists() or Attempt.objects.exists() or Evaluation.objects.exists())
    assert Racer.objects.filter(pk=bob.pk).exists()


def test_a_class_goes_with_its_open_assignment(alice, now):
    classroom = make_class(teacher=alice, name="7c", plan=[], now=now)
    (card,) = add_learners(classroom=classroom, by=alice, names=["Kim Minji"], now=now)
    assignment = an_assignment(classroom.group, now)
    finish_all(hand_in(assignment, card.learner.racer, now), laps(9_000), now)
    hand_in(assignment, card.learner.racer, now)
    with pytest.raises(UserFault):
        delete_class(classroom=classroom, by=alice)
    delete_class(classroom=classroom, by=alice, marks_exported=True)
    assert not (Assignment.objects.exists() or Attempt.objects.exists() or Evaluation.objects.exists())


def test_a_teacher_has_a_limit_of_assignments_under_way(alice, now, settings):
    settings.ASSIGNMENTS_PER_TEACHER = 1
    group, _students = a_group(alice, 0, now)
    over = an_assignment(group, now - 9 * DAY)
    an_assignment(group, now)
    with pytest.raises(UserFault) as refused:
        an_assignment(group, now)
    assert refused.value.code == "assignments_at_once" and over.due_at < now


def test_a_deleted_account_takes_attempts_and_marks_along(alice, now):
    group, (bob, carol, dave) = a_group(alice, 3, now)
    assignment = an_assignment(group, now)
    make_submission_group(assignment=assignment, by=alice, name="Red", racers=[carol, dave], now=now)
    for racer in (bob, carol):
        finish_all(hand_in(assignment, racer, now), laps(9_000, 9_000, 9_000), now)
    for racer in (bob, carol):
        delete_account(racer=racer, by=racer, now=timezone.now())
    attempt = Attempt.objects.get()
    assert (attempt.racer, attempt.model_name) == (dave, "")
    assert {mark.racer_id: mark.points for mark in Mark.objects.all()} == {dave.pk: 100}
    assert len(AttemptRun.objects.get().laps) == 3
