"""Student IDs of learners: how a course system knows them, for files of marks."""

from __future__ import annotations

import pytest

from accounts.class_accounts.services import add_learners, make_class, set_student_ids
from accounts.models import ClassLearner
from paddock.errors import UserFault
from tests.clients import logged_in

pytestmark = pytest.mark.django_db


@pytest.fixture
def room(alice, now):
    room = make_class(teacher=alice, name="6a", plan=[], now=now)
    add_learners(classroom=room, by=alice, names=["Kim Minji; kim@uni.example", "Ann Lee"], now=now)
    return room


def ids(room) -> dict[str, str]:
    return dict(ClassLearner.objects.filter(classroom=room).values_list("real_name", "student_id"))


def pk_of(room, name: str) -> int:
    return ClassLearner.objects.get(classroom=room, real_name=name).pk


def test_an_id_may_follow_the_name(room):
    assert ids(room) == {"Kim Minji": "kim@uni.example", "Ann Lee": ""}


@pytest.mark.parametrize("names", [["Bo; kim@uni.example"], ["Bo; 1", "Cy; 1"], ["; 1"]])
def test_an_id_of_two_learners_or_of_no_name_adds_nobody(room, alice, now, names):
    with pytest.raises(UserFault) as refused:
        add_learners(classroom=room, by=alice, names=names, now=now)
    assert refused.value.code == "class_student_id"
    assert len(ids(room)) == 2


def test_two_learners_can_swap_their_ids_and_one_can_be_removed(room, alice):
    kim, ann = pk_of(room, "Kim Minji"), pk_of(room, "Ann Lee")
    set_student_ids(classroom=room, by=alice, ids={kim: "", ann: "kim@uni.example"})
    assert ids(room) == {"Kim Minji": "", "Ann Lee": "kim@uni.example"}
    set_student_ids(classroom=room, by=alice, ids={kim: "kim@uni.example", ann: " 7 "})
    assert ids(room) == {"Kim Minji": "kim@uni.example", "Ann Lee": "7"}


@pytest.mark.parametrize("wanted", ["kim@uni.example", "x" * 81, "a‮b"])
def test_a_bad_id_changes_nothing(room, alice, wanted):
    before = ids(room)
    with pytest.raises(UserFault):
        set_student_ids(classroom=room, by=alice, ids={pk_of(room, "Ann Lee"): wanted})
    assert ids(room) == before


def test_only_teachers_set_and_see_ids(room, alice, bob):
    learner = ClassLearner.objects.get(real_name="Kim Minji").racer
    for other in (bob, learner):
        with pytest.raises(UserFault) as refused:
            set_student_ids(classroom=room, by=other, ids={})
        assert refused.value.code == "class_not_yours"
    assert "kim@uni.example" in logged_in(alice).get(room.get_absolute_url()).content.decode()
    for path in (f"/racers/{learner.alias}/", "/class/"):
        assert "kim@uni.example" not in logged_in(learner).get(path).content.decode()


def test_the_page_saves_all_ids_at_once(room, alice):
    kim, ann = pk_of(room, "Kim Minji"), pk_of(room, "Ann Lee")
    sent = {"do": "ids", "learner": [kim, ann], f"id-{kim}": "20261", f"id-{ann}": "20262"}
    assert logged_in(alice).post(room.get_absolute_url(), sent).status_code == 302
    assert ids(room) == {"Kim Minji": "20261", "Ann Lee": "20262"}
    sent[f"id-{ann}"] = "20261"
    page = logged_in(alice).post(room.get_absolute_url(), sent)
    assert page.status_code == 200 and "20261” does not fit" in page.content.decode()
    assert ids(room) == {"Kim Minji": "20261", "Ann Lee": "20262"}
