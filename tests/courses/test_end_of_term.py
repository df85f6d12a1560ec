"""A term ends: assignments are copied for the next one, personal data are deleted once marks were exported."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from django.core.cache import cache

from accounts.class_accounts.services import add_learners, make_class
from accounts.models import ClassLearner, Classroom, Racer, RacerGroup
from courses.assignments.services import extend, make_submission_group
from courses.classes.deletion import delete_class, delete_group_assignments, remove_learner
from courses.models import Assignment, Attempt, AttemptRun, Extension, Mark, PartTrack, SubmissionGroup, TrackKind
from evaluation.models import Evaluation, TrainedModel
from paddock.errors import UserFault
from tests.clients import logged_in
from tests.courses.assignments import DAY, a_group, a_part, an_assignment, finish_all, hand_in
from tests.factories import a_track, laps
from tests.rows import track_row

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _fresh(wakes, trainings_taken_on) -> None:
    cache.clear()


@pytest.fixture
def room(alice, now):
    """A class of two with an assignment that Kim has passed, and an extension of Ann's."""
    room = make_class(teacher=alice, name="6a", plan=["agent"], now=now)
    add_learners(classroom=room, by=alice, names=["Kim Minji; 1", "Ann Lee; 2"], now=now)
    parts = [a_part(tracks=[(a_track(), "shown"), (track_row("h-track"), "candidate")], hidden_tracks=1)]
    made = an_assignment(room.group, now, parts=parts)
    finish_all(hand_in(made, learner("Kim Minji"), now), laps(*[9_000] * 5), now)
    extend(
        assignment=made, racer=learner("Ann Lee"), by=alice, due_at=now + 3 * DAY, last_at=None, reason="Ill", now=now
    )
    return room


def learner(name: str) -> Racer:
    return ClassLearner.objects.get(real_name=name).racer


def test_a_class_with_marks_is_deleted_only_after_they_were_downloaded(room, alice, now):
    client, page = logged_in(alice), room.get_absolute_url()
    send = {"do": "delete", "confirm": "6a"}
    assert "There are marks that nobody has downloaded" in client.post(page, send, follow=True).content.decode()
    assert Classroom.objects.exists() and Mark.objects.exists()
    file = client.get(f"/assignments/of/{room.group.slug}/marks.csv?form=plain")
    assert file.status_code == 200 and "Kim Minji" in file.content.decode()
    assert client.post(page, send)["Location"] == "/classes/"
    for model in (Classroom, RacerGroup, ClassLearner, Assignment, Attempt, AttemptRun, Mark, Extension, TrainedModel):
        assert not model.objects.exists(), model
    assert not Evaluation.with_sealed.exists() and list(Racer.objects.filter(is_house=False)) == [alice]


def test_marks_that_changed_since_are_downloaded_again(room, alice, now):
    client = logged_in(alice)
    client.get(f"/assignments/of/{room.group.slug}/marks.csv?form=moodle")
    finish_all(hand_in(Assignment.objects.get(), learner("Ann Lee"), now), laps(*[9_000] * 5), now)
    client.post(room.get_absolute_url(), {"do": "delete", "confirm": "6a"})
    assert Classroom.objects.exists()


def test_without_marks_nothing_has_to_be_downloaded(alice, now):
    room = make_class(teacher=alice, name="6a", plan=[], now=now)
    add_learners(classroom=room, by=alice, names=["Kim Minji"], now=now)
    an_assignment(room.group, now)
    assert delete_class(classroom=room, by=alice) == 1 and not Assignment.objects.exists()


def test_the_api_deletes_a_class_with_marks_only_where_it_is_said(room, alice):
    client = logged_in(alice)
    answer = client.delete(f"/api/v1/classes/{room.group.slug}/")
    assert answer.status_code == 409 and answer.json()["code"] == "marks_not_exported" and Mark.objects.exists()
    assert client.delete(f"/api/v1/classes/{room.group.slug}/?marks_exported=true").status_code == 204
    assert not Mark.objects.exists()


def test_the_assignments_of_a_group_go_and_its_members_stay(alice, bob, now):
    group, (kim, ann) = a_group(alice, 2, now)
    made = an_assignment(group, now)
    run = hand_in(made, kim, now)
    finish_all(run, laps(*[9_000] * 5), now)
    for by in (bob, kim):
        with pytest.raises(UserFault):
            delete_group_assignments(group=group, by=by, marks_exported=True)
    client, path = logged_in(alice), f"/assignments/of/{group.slug}/delete/"
    assert "Write the name" in client.post(path, {"confirm": "x"}, follow=True).content.decode()
    assert "downloaded" in client.post(path, {"confirm": group.name}, follow=True).content.decode()
    client.get(f"/assignments/of/{group.slug}/marks.csv?form=plain")
    assert "All assignments deleted." in client.post(path, {"confirm": group.name}, follow=True).content.decode()
    assert not Assignment.objects.exists() and not Attempt.objects.exists() and not Mark.objects.exists()
    assert not Evaluation.objects.filter(owner=kim).exists() and TrainedModel.objects.filter(owner=kim).exists()
    assert {kim, ann} <= set(Racer.objects.all())


def test_a_learner_goes_with_attempts_and_marks(room, alice, now):
    made, kim, ann = Assignment.objects.get(), learner("Kim Minji"), learner("Ann Lee")
    finish_all(hand_in(made, ann, now), laps(9_000), now)
    remove_learner(classroom=room, by=alice, racer=kim)
    assert not Racer.objects.filter(pk=kim.pk).exists()
    assert list(Attempt.objects.values_list("racer", flat=True)) == [ann.pk]
    assert list(Mark.objects.values_list("racer", flat=True)) == [ann.pk]


def test_the_mark_of_a_group_stays_for_the_others_when_a_member_goes(alice, now):
    room = make_class(teacher=alice, name="6a", plan=[], now=now)
    add_learners(classroom=room, by=alice, names=["Kim Minji", "Ann Lee"], now=now)
    kim, ann = learner("Kim Minji"), learner("Ann Lee")
    made = an_assignment(room.group, now)
    make_submission_group(assignment=made, by=alice, name="Pair", racers=[kim, ann], now=now)
    finish_all(hand_in(made, kim, now), laps(*[9_000] * 5), now)
    remove_learner(classroom=room, by=alice, racer=kim)
    assert not ClassLearner.objects.filter(real_name="Kim Minji").exists()
    assert Mark.objects.get(racer=ann).points == 100 and Attempt.objects.get().racer == ann
    assert SubmissionGroup.objects.get().members.count() == 1


def test_a_copy_has_the_same_time_of_day_and_no_students(room, alice, now):
    """Half a year later the clocks differ by an hour."""
    due = datetime(2026, 11, 29, 22, 59, tzinfo=UTC)  # 23:59 in Berlin
    Assignment.objects.update(time_zone="Europe/Berlin", due_at=due)
    client, path = logged_in(alice), f"/assignments/copy/{room.group.slug}/"
    assert "Enter a name for the new class" in client.post(path, {"weeks": "26", "once": "a"}).content.decode()
    assert (
        "less than or equal to 520" in client.post(path, {"weeks": "9999", "name": "x", "once": "b"}).content.decode()
    )
    sent = {"weeks": "26", "name": "6b", "once": "c"}
    assert client.post(path, sent).status_code == 302
    client.post(path, sent)
    copy = Assignment.objects.exclude(group=room.group).get()
    assert copy.group.name == "6b" and copy.group.classroom.plan == ["agent"] and copy.published_at is None
    assert copy.due_at == datetime(2027, 5, 30, 21, 59, tzinfo=UTC)
    assert not copy.group.classroom.learners.exists() and not copy.attempts.exists() and not copy.extensions.exists()
    assert sorted(PartTrack.objects.filter(part__assignment=copy).values_list("kind", flat=True)) == [
        TrackKind.CANDIDATE,
        TrackKind.SHOWN,
    ]
    assert copy.draw_seed != Assignment.objects.get(group=room.group).draw_seed


def test_a_copy_goes_only_to_a_class_that_one_teaches(room, bob, alice, now):
    foreign = make_class(teacher=bob, name="7x", plan=[], now=now)
    path = f"/assignments/copy/{room.group.slug}/"
    assert logged_in(bob).get(path).status_code == 404
    page = logged_in(alice).post(path, {"weeks": "1", "to_group": foreign.group.slug, "once": "d"})
    assert page.status_code == 422 and not Assignment.objects.filter(group=foreign.group).exists()
