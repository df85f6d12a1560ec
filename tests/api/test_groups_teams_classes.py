"""Groups, teams and classes through the API: who may do what, and secrets that are shown once."""

from __future__ import annotations

import pytest
from django.test import Client
from django.utils import timezone
from rest_framework.test import APIClient

from accounts.class_accounts.services import LETTERS, add_learners, add_teacher, make_class, note_lesson
from accounts.groups.services import ask_to_join, confirm_member, make_group
from accounts.models import ClassLearner, Classroom, GroupMember, Racer, RacerGroup, Team, TeamMember
from accounts.teams.services import found_team, invite_to_team
from accounts.tokens.services import create_token
from tests.factories import a_race, a_racer, drive, laps
from training.lessons.catalogue import LESSONS

pytestmark = pytest.mark.django_db
ROLES = ("owner", "member", "stranger", "admin", "anonymous")
API = "/api/v1"


@pytest.fixture
def group(alice, bob) -> RacerGroup:
    made = make_group(by=alice, name="Owls", now=timezone.now())
    confirm_member(member=ask_to_join(code=made.code, racer=bob, now=timezone.now()), by=alice, now=timezone.now())
    return made


@pytest.fixture
def team(alice, bob) -> Team:
    made = found_team(by=alice, name="Reds", now=timezone.now())
    TeamMember.objects.create(team=made, racer=bob, joined_at=timezone.now())
    return made


@pytest.fixture
def classroom(alice, bob) -> Classroom:
    made = make_class(teacher=alice, name="7c", plan=["agent"], now=timezone.now())
    add_teacher(classroom=made, by=alice, alias="bob", now=timezone.now())
    add_learners(classroom=made, by=alice, names=["Kim Minji", "Ann Lee"], now=timezone.now())
    return made


def learner_of(classroom: Classroom) -> Racer:
    return classroom.learners.get(real_name="Ann Lee").racer


def statuses(cast: dict[str, APIClient], method: str, path: str, body: dict | None = None) -> dict[str, int]:
    """The answer to each of the cast; strangers first, so that a change by the owner does not help them."""
    return {
        role: getattr(cast[role], method)(f"{API}{path}", body).status_code
        for role in ("anonymous", "stranger", "member", "admin", "owner")
    }


# expected answers in the order of ROLES
GROUP_TABLE = [
    ("get", "/groups/owls/", None, (200, 200, 404, 200, 404)),
    ("patch", "/groups/owls/", {"name": "Night Owls"}, (200, 403, 404, 200, 401)),
    ("post", "/groups/owls/link/", None, (200, 403, 404, 200, 401)),
    ("get", "/groups/owls/members/", None, (200, 200, 404, 200, 404)),
    ("patch", "/groups/owls/members/bob/", {"role": "member"}, (200, 403, 404, 200, 401)),
    ("delete", "/groups/owls/membership/", None, (404, 204, 404, 404, 401)),
]
TEAM_TABLE = [
    ("get", "/teams/reds/", None, (200, 200, 200, 200, 200)),
    ("post", "/teams/reds/link/", None, (200, 403, 403, 200, 401)),
    ("get", "/teams/reds/members/", None, (200, 200, 200, 200, 200)),
    ("patch", "/teams/reds/members/alice/", {"role": "captain"}, (200, 403, 403, 200, 401)),
    ("get", "/teams/reds/invitations/", None, (200, 200, 200, 200, 401)),
    ("post", "/teams/reds/invitations/", {"racer": "dora"}, (201, 403, 403, 201, 401)),
    ("post", "/teams/reds/membership/", None, (200, 200, 403, 403, 401)),
]
# "member" is here the second teacher
CLASS_TABLE = [
    ("get", "/classes/7c/", None, (200, 200, 404, 404, 401)),
    ("patch", "/classes/7c/", {"plan": ["reward"]}, (200, 200, 404, 404, 401)),
    ("get", "/classes/7c/learners/", None, (200, 200, 404, 404, 401)),
    ("post", "/classes/7c/learners/", {"names": ["Jo Park"]}, (201, 201, 404, 404, 401)),
    ("post", "/classes/7c/codes/", None, (200, 200, 404, 404, 401)),
    ("get", "/classes/7c/teachers/", None, (200, 200, 404, 404, 401)),
    ("post", "/classes/7c/teachers/", {"alias": "dora"}, (201, 403, 404, 404, 401)),
    ("delete", "/classes/7c/teachers/dora/", None, (404, 403, 404, 404, 401)),
]


@pytest.mark.parametrize(
    ("method", "path", "body", "expected"), GROUP_TABLE + TEAM_TABLE + CLASS_TABLE, ids=lambda one: str(one)[:40]
)
def test_each_of_the_cast_gets_the_expected_answer(cast, group, team, classroom, method, path, body, expected):
    a_racer("dora")
    assert statuses(cast, method, path, body) == dict(zip(ROLES, expected, strict=True))


@pytest.mark.parametrize(
    ("method", "path"),
    [(method, path) for method, path, *_ in GROUP_TABLE + TEAM_TABLE + CLASS_TABLE if method != "get"],
)
def test_a_stranger_is_refused_before_the_body_is_read(cast, group, team, classroom, method, path):
    send = getattr(cast["stranger"], method)
    assert send(f"{API}{path}", {"nonsense": 1}).status_code in (403, 404)
    assert send(f"{API}{path}", "{", content_type="application/json").status_code in (403, 404)


def test_a_learner_sees_their_class_as_a_group_and_creates_no_class(as_racer, classroom):
    client = as_racer(learner_of(classroom))
    assert client.get(f"{API}/classes/7c/").status_code == 404
    assert "Kim Minji" not in client.get(f"{API}/groups/7c/members/").content.decode()
    assert client.get(f"{API}/groups/7c/members/").data["count"] == 4
    answer = client.post(f"{API}/classes/", {"name": "Mine"})
    assert (answer.status_code, answer.data["code"]) == (403, "class_no_teacher")


def test_a_group_from_creation_to_deletion(cast):
    owner, stranger = cast["owner"], cast["stranger"]
    made = owner.post(f"{API}/groups/", {"name": "Owls", "description": "Night races"})
    assert (made.status_code, made.data["slug"], made.data["leader"]) == (201, "owls", "alice")
    assert stranger.post(f"{API}/groups/join/", {"code": "wrong"}).status_code == 404
    asked = stranger.post(f"{API}/groups/join/", {"code": f"https://site.example/groups/join/{made.data['code']}/"})
    assert asked.data["role"] == "asked"
    assert stranger.post(f"{API}/groups/join/", {"code": made.data["code"]}).data == asked.data
    assert stranger.get(f"{API}/groups/?mine=true").data["results"][0]["code"] == ""
    assert owner.patch(f"{API}/groups/owls/members/charlie/", {"role": "member"}).data["role"] == "member"
    assert owner.patch(f"{API}/groups/owls/", {"description": ""}).data["name"] == "Owls"
    renewed = owner.post(f"{API}/groups/owls/link/").data["code"]
    assert renewed and renewed != made.data["code"]
    assert owner.patch(f"{API}/groups/owls/members/charlie/", {"role": "leader"}).data["role"] == "leader"
    assert owner.delete(f"{API}/groups/owls/").status_code == 404  # no member and no leader any more
    assert stranger.delete(f"{API}/groups/owls/").status_code == 204
    assert not RacerGroup.objects.exists()


def test_a_leader_removes_a_member_and_a_member_leaves(cast, group):
    assert cast["owner"].delete(f"{API}/groups/owls/members/bob/").status_code == 204
    assert not GroupMember.objects.filter(group=group).exists()
    assert cast["member"].delete(f"{API}/groups/owls/membership/").status_code == 404


def test_a_guest_lists_listed_groups_only(cast, group):
    guest = cast["anonymous"]
    RacerGroup.objects.update(leader=None)
    assert guest.get(f"{API}/groups/").data["count"] == 0
    RacerGroup.objects.update(is_listed=True)
    assert guest.get(f"{API}/groups/").data["results"][0]["code"] == ""
    assert guest.get(f"{API}/groups/?mine=true").data["count"] == 0


def test_a_team_from_its_founding_to_its_end(cast, charlie):
    owner, stranger = cast["owner"], cast["stranger"]
    made = owner.post(f"{API}/teams/", {"name": "Reds"})
    assert (made.status_code, made.data["captain"], made.data["members"]) == (201, "alice", 1)
    again = cast["member"].post(f"{API}/teams/", {"name": "reds"})
    assert (again.status_code, again.data["code"]) == (409, "team_name_taken")
    assert cast["member"].post(f"{API}/teams/join/", {"code": made.data["code"]}).data["members"] == 2
    assert owner.post(f"{API}/teams/reds/invitations/", {"racer": "charlie"}).status_code == 201
    assert stranger.get(f"{API}/teams/?invited=true").data["results"][0]["slug"] == "reds"
    assert stranger.delete(f"{API}/teams/reds/invitations/charlie/").status_code == 204
    assert stranger.post(f"{API}/teams/reds/membership/").data["code"] == "team_not_asked"
    invite_to_team(team=Team.objects.get(), alias="charlie", by=Racer.objects.get(alias="alice"), now=timezone.now())
    assert stranger.post(f"{API}/teams/reds/membership/").data["members"] == 3
    assert stranger.get(f"{API}/teams/?mine=true").data["count"] == 1
    assert owner.delete(f"{API}/teams/reds/membership/").data["code"] == "team_hand_over_first"
    assert owner.patch(f"{API}/teams/reds/members/bob/", {"role": "captain"}).data["role"] == "captain"
    assert owner.delete(f"{API}/teams/reds/membership/").status_code == 204
    assert cast["member"].delete(f"{API}/teams/reds/members/charlie/").status_code == 204
    assert cast["member"].delete(f"{API}/teams/reds/membership/").status_code == 204
    assert not Team.objects.exists()


def test_a_code_to_join_is_for_the_leader_with_the_scope_alone(cast, alice, bob, group, team):
    for path, scope in ((f"{API}/groups/owls/", "organise"), (f"{API}/teams/reds/", "race")):
        assert cast["owner"].get(path).data["code"]
        assert cast["member"].get(path).data["code"] == ""
        for scopes, shown in ((("read",), False), (("read", scope), True)):
            client = APIClient()
            text = create_token(racer=alice, now=timezone.now(), scopes=scopes)[1]
            client.credentials(HTTP_AUTHORIZATION=f"Bearer {text}")
            assert bool(client.get(path).data["code"]) == shown


def test_a_class_from_creation_to_deletion(cast, bob):
    owner = cast["owner"]
    made = owner.post(f"{API}/classes/", {"name": "7c"})
    assert (made.status_code, made.data["plan"]) == (201, [lesson.slug for lesson in LESSONS])
    assert owner.patch(f"{API}/classes/7c/", {"plan": ["reward", "nonsense"]}).status_code == 400
    added = owner.post(f"{API}/classes/7c/learners/", {"names": ["Kim Minji", "Ann Lee"]})
    assert [card["name"] for card in added.data["cards"]] == ["Kim Minji", "Ann Lee"]
    assert owner.post(f"{API}/classes/7c/teachers/", {"alias": "bob"}).status_code == 201
    assert cast["member"].delete(f"{API}/classes/7c/teachers/bob/").status_code == 204
    assert owner.get(f"{API}/classes/").data["results"][0]["learners"] == 2
    assert owner.delete(f"{API}/classes/7c/learners/{added.data['cards'][0]['alias']}/").status_code == 204
    assert owner.delete(f"{API}/classes/7c/").status_code == 204
    assert not Classroom.objects.exists() and not ClassLearner.objects.exists()


@pytest.mark.parametrize("names", [[], ["x" * 81], ["two\nlines"], ["turned \u202e"], [" "], "Kim", None])
def test_invalid_names_add_nobody(cast, classroom, names):
    assert cast["owner"].post(f"{API}/classes/7c/learners/", {"names": names}).status_code == 400
    assert ClassLearner.objects.count() == 2


def test_a_code_logs_in_and_is_shown_once(cast, classroom):
    answer = cast["owner"].post(f"{API}/classes/7c/learners/", {"names": ["Jo Park"]})
    assert answer["Cache-Control"] == "no-store"
    (card,) = answer.data["cards"]
    assert set(card["code"]) <= {*LETTERS, "-"} and card["link"].endswith(f"/{card['code'].replace('-', '')}/")
    assert Client().post("/class/", {"code": card["code"]}).status_code == 302
    for path in ("/classes/7c/", "/classes/7c/learners/", "/groups/7c/members/"):
        assert card["code"].replace("-", "") not in cast["owner"].get(f"{API}{path}").content.decode().replace("-", "")


def test_a_teacher_reads_the_progress_of_learners(cast, classroom):
    ann = learner_of(classroom)
    note_lesson(racer=ann, slug="agent", now=timezone.now())
    now = timezone.now()
    race = a_race(now, slug="lesson", group=classroom.group, organiser=Racer.objects.get(alias="alice"))
    drive(race, ann, laps(10_000, 9_000, 11_000), now)
    answer = cast["owner"].get(f"{API}/classes/7c/learners/")
    row, kim = answer.data["results"]
    assert (row["name"], list(row["lessons"]), row["race"]) == ("Ann Lee", ["agent"], "lesson")
    assert (row["trainings"], row["best_lap_ms"]) == (0, 9_000)
    assert (kim["name"], kim["race"], kim["best_lap_ms"]) == ("Kim Minji", None, None)
    assert answer["Cache-Control"] == "no-store"
    assert cast["owner"].get(f"{API}/classes/7c/learners/?page_size=1&page=2").data["results"][0]["name"] == "Kim Minji"


def test_renewed_codes_are_of_the_named_learners(cast, classroom):
    ann, everybody = learner_of(classroom).alias, f"{API}/classes/7c/codes/"
    before = dict(ClassLearner.objects.values_list("real_name", "code_digest"))
    answer = cast["owner"].post(everybody, {"learners": [ann]})
    assert (len(answer.data["cards"]), answer["Cache-Control"]) == (1, "no-store")
    after = dict(ClassLearner.objects.values_list("real_name", "code_digest"))
    assert after["Ann Lee"] != before["Ann Lee"] and after["Kim Minji"] == before["Kim Minji"]
    unknown = cast["owner"].post(everybody, {"learners": [ann, "alice"]})
    assert (unknown.status_code, unknown.data["code"]) == (404, "class_learner_unknown")
    assert dict(ClassLearner.objects.values_list("real_name", "code_digest")) == after
    assert len(cast["owner"].post(everybody).data["cards"]) == 2


def test_a_teacher_changes_the_student_id_of_a_learner(cast, classroom):
    first, second = (
        f"{API}/classes/7c/learners/{learner.racer.alias}/" for learner in ClassLearner.objects.order_by("pk")
    )
    changed = cast["owner"].patch(first, {"student_id": "20261"})
    assert (changed.status_code, changed.data["student_id"], changed["Cache-Control"]) == (200, "20261", "no-store")
    refused = cast["owner"].patch(second, {"student_id": "20261"})
    assert (refused.status_code, refused.data["code"]) == (400, "class_student_id")
    assert cast["owner"].patch(first, {}).data["student_id"] == "20261"
    rows = cast["owner"].get(f"{API}/classes/7c/learners/").data["results"]
    assert sorted(row["student_id"] for row in rows) == ["", "20261"]
    assert cast["owner"].patch(first, {"student_id": ""}).data["student_id"] == ""
    for other, status in (("member", 200), ("stranger", 404), ("admin", 404), ("anonymous", 401)):
        assert cast[other].patch(first, {"student_id": "7"}).status_code == status


def test_real_names_and_student_ids_need_the_scope_organise(alice, classroom):
    classroom.learners.filter(real_name="Ann Lee").update(student_id="20262")
    for scopes, shown in ((("read",), ("", "")), (("read", "organise"), ("Ann Lee", "20262"))):
        client = APIClient()
        text = create_token(racer=alice, now=timezone.now(), scopes=scopes)[1]
        client.credentials(HTTP_AUTHORIZATION=f"Bearer {text}")
        row = client.get(f"{API}/classes/7c/learners/").data["results"][0]
        assert (row["name"], row["student_id"]) == shown
