"""Launches from a platform: accounts, classes, teachers, and what belongs to whom."""

from __future__ import annotations

import pytest
from django.test import Client

from accounts.class_accounts.services import add_learners, can_teach, make_class
from accounts.models import ClassLearner, GroupMember, Racer
from courses.lti.keys import key_set
from courses.models import LtiAccount, LtiContext
from tests.clients import logged_in
from tests.courses.lti.launching import launched, refused, send
from tests.courses.lti.platform import CLAIM, ROLE, Platform
from tests.factories import a_racer

pytestmark = pytest.mark.django_db


def racer_in(client: Client) -> Racer:
    return Racer.objects.get(pk=client.session["_auth_user_id"])


class TestTeachers:
    def test_a_first_launch_asks_for_the_account_and_the_class(self, registered, platform):
        client, answer = launched(platform, "t-1")
        assert 'value="new"' in answer.content.decode()
        assert not LtiContext.objects.exists()
        answer = client.post("/lti/arrival/", {"do": "new"})
        assert 'value="new-class"' in answer.content.decode()
        answer = client.post("/lti/arrival/", {"do": "new-class"})
        context = LtiContext.objects.select_related("group__classroom").get()
        assert answer["Location"] == context.group.classroom.get_absolute_url()
        assert context.group.name == context.title == "Reinforcement learning"
        assert context.group.leader == racer_in(client)

    def test_a_later_launch_asks_nothing(self, course, platform):
        client, answer = launched(platform, "t-1")
        assert answer["Location"] == course.group.classroom.get_absolute_url()
        assert racer_in(client) == course.group.leader

    def test_a_logged_in_teacher_links_their_account_and_one_of_their_classes(self, registered, platform, alice, now):
        taught = make_class(teacher=alice, name="Mine", plan=(), now=now)
        client, _answer = launched(platform, "t-1", client=logged_in(alice), do=("link",))
        client.post("/lti/arrival/", {"do": "class", "class": taught.pk})
        assert LtiContext.objects.get().group == taught.group
        assert launched(platform, "t-1")[0].session["_auth_user_id"] == str(alice.pk)

    def test_no_course_is_linked_with_somebody_elses_class(self, registered, platform, alice, bob, now):
        taught = make_class(teacher=bob, name="Theirs", plan=(), now=now)
        client, _answer = launched(platform, "t-1", client=logged_in(alice), do=("link",))
        assert client.post("/lti/arrival/", {"do": "class", "class": taught.pk}).status_code == 404
        assert not LtiContext.objects.exists()

    def test_a_second_teacher_teaches_the_class(self, course, platform):
        platform.people["t-2"] = ("Barbara Liskov", "Instructor")
        client, _answer = launched(platform, "t-2", do=("new",))
        assert can_teach(racer_in(client), course.group.classroom)
        assert racer_in(client) != course.group.leader

    def test_an_assistant_is_a_teacher(self, course, platform):
        role = "http://purl.imsglobal.org/vocab/lis/v2/membership/Instructor#TeachingAssistant"
        client, _answer = launched(platform, "s-1", do=("new",), **{f"{CLAIM}roles": [role]})
        assert can_teach(racer_in(client), course.group.classroom)


class TestStudents:
    def test_a_first_launch_makes_a_class_account(self, course, platform):
        client, answer = launched(platform, "s-1")
        racer = racer_in(client)
        assert answer["Location"] == "/assignments/"
        assert ClassLearner.objects.get(racer=racer).real_name == "Ada Lovelace"
        assert racer.learner.classroom == course.group.classroom
        assert "ada" not in racer.alias.lower()
        assert racer.email.endswith("@learner.invalid")

    def test_a_second_launch_finds_the_same_account(self, course, platform):
        first = racer_in(launched(platform, "s-1")[0])
        assert racer_in(launched(platform, "s-1")[0]) == first
        assert racer_in(launched(platform, "s-2")[0]) != first

    def test_a_student_before_the_teacher_is_refused(self, registered, platform):
        _client, answer = launched(platform, "s-1")
        assert refused(answer) == "lti_no_class"
        assert not Racer.objects.exists()

    def test_no_account_is_taken_over_by_its_address(self, course, platform):
        known = Racer.objects.create_user("ada", "s-1@example.edu", "secret")
        assert racer_in(launched(platform, "s-1")[0]) != known

    def test_a_logged_in_racer_may_keep_their_account(self, course, platform, alice):
        client, answer = launched(platform, "s-1", client=logged_in(alice))
        assert alice.alias in answer.content.decode()
        client.post("/lti/arrival/", {"do": "link"})
        assert racer_in(launched(platform, "s-1")[0]) == alice
        assert course.group.members.filter(racer=alice, confirmed_at__isnull=False).exists()
        assert not can_teach(alice, course.group.classroom)

    def test_who_had_asked_to_join_is_confirmed(self, course, platform, alice, now):
        GroupMember.objects.create(group=course.group, racer=alice, asked_at=now)
        launched(platform, "s-1", client=logged_in(alice), do=("link",))
        assert GroupMember.objects.get(racer=alice).confirmed_at is not None

    def test_a_logged_in_racer_may_take_a_new_account(self, course, platform, alice):
        client, _answer = launched(platform, "s-1", client=logged_in(alice), do=("new",))
        assert racer_in(client) != alice
        assert not LtiAccount.objects.filter(racer=alice).exists()

    def test_one_account_is_not_two_persons(self, course, platform, alice):
        launched(platform, "s-1", client=logged_in(alice), do=("link",))
        _client, answer = launched(platform, "s-2", client=logged_in(alice), do=("link",))
        assert refused(answer) == "lti_account_taken"

    def test_a_person_of_two_courses_has_a_class_account_in_each(self, course, platform):
        other = {f"{CLAIM}context": {"id": "course-8", "title": "Robots"}}
        launched(platform, "t-1", do=("new-class",), **other)
        first, second = racer_in(launched(platform, "s-1")[0]), racer_in(launched(platform, "s-1", **other)[0])
        assert first != second
        assert second.learner.classroom.group.name == "Robots"

    def test_a_learner_of_a_class_is_not_linked_elsewhere(self, course, platform, alice, now):
        other = make_class(teacher=alice, name="Other", plan=(), now=now)
        (card,) = add_learners(classroom=other, by=alice, names=["Ada"], now=now)
        client, _answer = launched(platform, "s-1", client=logged_in(card.learner.racer))
        assert racer_in(client) != card.learner.racer


class TestWhoIsNotLoggedIn:
    def test_no_admin_can_be_linked(self, registered, platform):
        admin = a_racer(is_staff=True)
        client, answer = launched(platform, "t-1", client=logged_in(admin))
        assert admin.alias not in answer.content.decode().partition("<h1>")[2]
        assert refused(client.post("/lti/arrival/", {"do": "link"})) == "lti_account"

    def test_who_has_become_an_admin_is_not_logged_in(self, course, platform):
        Racer.objects.filter(pk=course.group.leader_id).update(is_staff=True)
        client, answer = launched(platform, "t-1")
        assert refused(answer) == "lti_account"
        assert "_auth_user_id" not in client.session

    def test_a_closed_account_is_not_logged_in(self, course, platform):
        racer = racer_in(launched(platform, "s-1")[0])
        Racer.objects.filter(pk=racer.pk).update(is_active=False)
        assert refused(launched(platform, "s-1")[1]) == "lti_account"

    @pytest.mark.parametrize(
        "roles",
        [
            [],
            None,
            "Guest",
            [f"{ROLE}Mentor"],
            ["http://purl.imsglobal.org/vocab/lis/v2/institution/person#Instructor"],
            [f"{ROLE}InstructorX"],
            [7, {"a": 1}],
        ],
    )
    def test_neither_student_nor_teacher_of_the_course(self, course, platform, roles):
        answer = send(Client(), platform, "s-1", {f"{CLAIM}roles": roles})
        assert refused(answer) in ("lti_role", "lti_message")

    def test_an_instructor_elsewhere_is_a_student_here(self, course, platform):
        roles = ["http://purl.imsglobal.org/vocab/lis/v2/institution/person#Instructor", f"{ROLE}Learner"]
        client, _answer = launched(platform, "s-1", **{f"{CLAIM}roles": roles})
        assert not can_teach(racer_in(client), course.group.classroom)

    def test_an_instructor_of_another_course_does_not_teach_this_one(self, course, platform):
        client, _answer = launched(platform, "s-1")
        mine = racer_in(client)
        other = {f"{CLAIM}context": {"id": "course-8"}, f"{CLAIM}roles": [f"{ROLE}Instructor"]}
        client, _answer = launched(platform, "s-1", do=("new", "new-class"), **other)
        assert racer_in(client) != mine
        assert not can_teach(racer_in(client), course.group.classroom)
        assert not can_teach(mine, course.group.classroom)


def test_the_library_names_the_key_that_platforms_find(platform: Platform, db):
    assert key_set() == Client().get("/lti/keys.json").json()
    assert "d" not in key_set()["keys"][0]
    assert key_set()["keys"][0]["alg"] == "RS256"
