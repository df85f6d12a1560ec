"""A class with several teachers, and a learner who leaves it."""

from __future__ import annotations

import pytest
from django.core.cache import cache
from django.db import IntegrityError, transaction

from accounts.class_accounts.services import (
    MOST_TEACHERS,
    add_learners,
    add_teacher,
    can_lead_class,
    can_teach,
    change_plan,
    classes_taught_by,
    make_class,
    new_codes,
    remove_teacher,
)
from accounts.following import can_follow
from accounts.groups.selectors import groups_to_hold_for, may_hold_for
from accounts.models import ClassLearner, ClassTeacher, Racer
from courses.classes.deletion import delete_class, remove_learner
from evaluation.models import Evaluation, TrainedModel
from paddock.errors import UserFault
from races.boards.selectors.board import board_entries
from races.models import DuelCompetitor, Entry, Race
from tests.clients import logged_in
from tests.factories import a_model, a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _fresh(wakes, trainings_taken_on) -> None:
    cache.clear()


def code(call) -> str:
    with pytest.raises(UserFault) as refused:
        call()
    return refused.value.code


@pytest.fixture
def cast(alice, bob, charlie, now):
    """Alice leads the class, Bob is its second teacher, Charlie teaches another one."""
    room = make_class(teacher=alice, name="6a", plan=["agent"], now=now)
    cards = add_learners(classroom=room, by=alice, names=["Kim Minji", "Ann Lee"], now=now)
    other = make_class(teacher=charlie, name="6b", plan=[], now=now)
    add_teacher(classroom=room, by=alice, alias="BOB", now=now)
    return {
        "room": room,
        "other": other,
        "alice": alice,
        "bob": bob,
        "charlie": charlie,
        "kim": cards[0].learner.racer,
        "ann": cards[1].learner.racer,
        "staff": a_racer(is_staff=True, is_superuser=True),
        "nobody": None,
    }


ROLES = {  # who teaches the class, and who leads it
    "alice": (True, True),
    "bob": (True, False),
    "charlie": (False, False),
    "kim": (False, False),
    "staff": (False, False),
    "nobody": (False, False),
}


@pytest.mark.parametrize("who", ROLES)
def test_each_predicate_agrees_with_its_queryset(cast, who):
    viewer, room = cast[who], cast["room"]
    teaches, leads = ROLES[who]
    assert can_teach(viewer, room) is teaches
    assert classes_taught_by(viewer).filter(pk=room.pk).exists() is teaches
    assert can_lead_class(viewer, room) is leads
    if viewer is None:
        return
    holds = may_hold_for(viewer, room.group)
    assert holds is (teaches or viewer.is_staff)
    assert groups_to_hold_for(viewer).filter(pk=room.group_id).exists() is holds
    for learner in (cast["kim"], cast["ann"]):
        of_the_class = teaches or (who == "kim" and learner != viewer)
        assert can_follow(viewer, learner) is of_the_class
        assert can_follow(learner, viewer) is of_the_class
    assert (logged_in(viewer).get(room.get_absolute_url()).status_code == 200) is teaches


def test_a_second_teacher_teaches_but_does_not_lead(cast, now):
    room, bob = cast["room"], cast["bob"]
    page = logged_in(bob).get(room.get_absolute_url()).content.decode()
    assert "Kim Minji" in page and 'id="delete"' not in page and 'value="add-teacher"' not in page
    assert len(add_learners(classroom=room, by=bob, names=["Lee"], now=now)) == 1
    assert len(new_codes(classroom=room, by=bob)) == 3
    change_plan(classroom=room, by=bob, plan=[])
    for act in (
        lambda: delete_class(classroom=room, by=bob),
        lambda: add_teacher(classroom=room, by=bob, alias="charlie", now=now),
        lambda: remove_teacher(classroom=room, by=bob, racer=cast["alice"]),
    ):
        assert code(act) == "class_not_yours"
    assert code(lambda: add_learners(classroom=cast["other"], by=bob, names=["x"], now=now)) == "class_not_yours"


def test_learners_count_for_the_teacher_who_leads(cast, now, settings):
    settings.LEARNERS_PER_TEACHER = 2
    assert code(lambda: add_learners(classroom=cast["room"], by=cast["bob"], names=["x"], now=now)) == "class_too_many"


@pytest.mark.parametrize("alias", ["nobody-here", "alice", "kim", ""])
def test_who_cannot_teach_a_class_is_refused(cast, now, alias):
    alias = cast["kim"].alias if alias == "kim" else alias
    call = lambda: add_teacher(classroom=cast["room"], by=cast["alice"], alias=alias, now=now)  # noqa: E731
    assert code(call) == "class_teacher_unknown"


def test_a_teacher_is_added_once_and_a_class_has_so_many(cast, now):
    room, alice = cast["room"], cast["alice"]
    add_teacher(classroom=room, by=alice, alias="bob", now=now)
    assert room.teachers.count() == 1
    with pytest.raises(IntegrityError), transaction.atomic():
        ClassTeacher.objects.create(classroom=room, racer=cast["bob"], added_at=now)
    for number in range(MOST_TEACHERS - 1):
        add_teacher(classroom=room, by=alice, alias=a_racer(f"t{number}").alias, now=now)
    assert code(lambda: add_teacher(classroom=room, by=alice, alias="charlie", now=now)) == "class_too_many_teachers"


def test_a_second_teacher_leaves_or_is_removed_and_sees_no_names_any_more(cast, now):
    room, alice, bob = cast["room"], cast["alice"], cast["bob"]
    address = room.get_absolute_url()
    left = logged_in(bob).post(address, {"do": "remove-teacher", "alias": "bob"})
    assert left["Location"] == "/classes/" and not can_teach(bob, room)
    assert logged_in(bob).get(address).status_code == 404
    assert not room.group.members.filter(racer=bob).exists()
    boss = logged_in(alice)
    assert boss.post(address, {"do": "add-teacher", "alias": "bob"}).status_code == 302 and can_teach(bob, room)
    assert boss.post(address, {"do": "remove-teacher", "alias": "bob"}).status_code == 302 and not can_teach(bob, room)
    assert "No racer of this alias" in boss.post(address, {"do": "add-teacher", "alias": "?"}).content.decode()


def a_class_race(cast, now, **fields) -> Race:
    return a_race(now, slug="class", organiser=cast["alice"], group=cast["room"].group, **fields)


@pytest.mark.parametrize("who", ["alice", "bob"])
def test_a_learner_is_taken_out_with_all_they_left_and_the_others_stay(cast, now, who):
    race = a_class_race(cast, now)
    gone, stays = cast["kim"], cast["ann"]
    mine = drive(race, gone, laps(9_000, 9_100, 9_200), now).evaluation
    theirs = drive(race, stays, laps(9_500, 9_600, 9_700), now).evaluation
    a_model(gone)
    client = logged_in(cast[who])
    address = cast["room"].get_absolute_url()
    unsure = client.post(address, {"do": "take-out", "learner": gone.pk}, follow=True)
    assert "confirm" in unsure.content.decode() and Racer.objects.filter(pk=gone.pk).exists()
    page = client.post(address, {"do": "take-out", "learner": gone.pk, "sure": "on"}, follow=True).content.decode()
    assert "Kim Minji is out of the class." in page and gone.alias not in page
    assert not Racer.objects.filter(pk=gone.pk).exists() and not ClassLearner.objects.filter(racer=gone.pk).exists()
    assert (
        not Evaluation.objects.filter(pk=mine.pk).exists() and not TrainedModel.objects.filter(owner=gone.pk).exists()
    )
    assert Evaluation.objects.filter(pk=theirs.pk).exists()
    assert [entry.racer for entry in board_entries(race).filter(is_baseline=False)] == [stays]
    assert Entry.objects.filter(race=race).count() == 1


def test_only_teachers_of_the_class_take_a_learner_out(cast):
    for by in (cast["charlie"], cast["staff"], cast["ann"]):
        assert code(lambda by=by: remove_learner(classroom=cast["room"], by=by, racer=cast["kim"])) == "class_not_yours"
    mine = {"classroom": cast["other"], "by": cast["charlie"]}
    assert code(lambda: remove_learner(**mine, racer=cast["kim"])) == "class_not_yours"


def test_results_of_a_learner_in_drawn_duels_stay_without_the_name(cast, now):
    from races.models import Duel

    race = a_class_race(cast, now, race_type="head_to_head", opponents="models", duel_format="round_robin")
    entry = Entry.objects.create(race=race, racer=cast["kim"], entered_at=now)
    duel = Duel.objects.create(race=race, round=1, number=1)
    DuelCompetitor.objects.create(duel=duel, entry=entry, grid=1)
    remove_learner(classroom=cast["room"], by=cast["alice"], racer=cast["kim"])
    left = Racer.objects.get(pk=cast["kim"].pk)
    assert left.alias == f"deleted-racer-{left.pk}" and duel.cars.get().entry == entry
    assert not cast["room"].learners.filter(racer=left).exists()


def test_deleting_the_class_leaves_its_second_teacher(cast):
    delete_class(classroom=cast["room"], by=cast["alice"])
    assert Racer.objects.filter(pk=cast["bob"].pk).exists() and not ClassTeacher.objects.exists()
