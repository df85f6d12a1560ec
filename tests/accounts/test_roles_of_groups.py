"""Roles that a provider's groups give and take: what is read of PADDOCK_SSO_GROUPS, and what it does to a racer."""

from __future__ import annotations

import pytest
from django.contrib.auth.models import Group

from accounts.single_sign_on.role_mapping import roles_in
from accounts.single_sign_on.roles import apply_roles
from tests.factories import a_racer

pytestmark = pytest.mark.django_db


@pytest.fixture
def mapping(settings):
    def use(text: str) -> None:
        settings.SSO_ROLES = roles_in(text)

    return use


def marks(racer) -> tuple[bool, bool]:
    racer.refresh_from_db()
    return racer.is_staff, racer.is_superuser


def test_pairs_of_groups_and_roles():
    assert roles_in(" Admins = admin,a=b=teacher, x y=group:Race control,") == (
        ("admins", "admin"),
        ("a=b", "teacher"),
        ("x y", "group:Race control"),
    )


@pytest.mark.parametrize("text", ["admins", "=admin", "admins=boss", "admins=group:", "admins=group: ", "admins="])
def test_a_pair_without_a_group_or_with_an_unknown_role_is_refused(text):
    with pytest.raises(ValueError):
        roles_in(text)


@pytest.mark.parametrize(
    ("before", "groups", "after"),
    [
        ((False, False), ["A"], (True, True)),
        ((False, False), ["s"], (True, False)),
        ((False, False), ["a", "s"], (True, True)),
        ((True, True), ["s"], (True, False)),
        ((True, True), [], (False, False)),
        ((True, False), ["other"], (False, False)),
    ],
)
def test_named_roles_follow_the_groups(mapping, before, groups, after):
    mapping("a=admin,s=steward")
    racer = a_racer("alice", is_staff=before[0], is_superuser=before[1])
    apply_roles(racer=racer, groups=groups)
    assert marks(racer) == after
    assert apply_roles(racer=racer, groups=groups) == []


@pytest.mark.parametrize(
    ("text", "before"), [("s=steward", (True, True)), ("a=admin", (True, False)), ("", (True, True))]
)
def test_a_role_that_is_not_named_stays(mapping, text, before):
    mapping(text)
    racer = a_racer("alice", is_staff=before[0], is_superuser=before[1])
    assert apply_roles(racer=racer, groups=[]) == []
    assert marks(racer) == before


def test_a_steward_by_hand_can_become_an_admin(mapping):
    mapping("a=admin")
    racer = a_racer("alice", is_staff=True)
    assert apply_roles(racer=racer, groups=["a"]) == ["-steward", "+admin"]


def test_teachers_get_learners_where_others_have_none(mapping, settings):
    mapping("t=teacher")
    settings.LEARNERS_PER_TEACHER = 0
    racer = a_racer("alice")
    assert apply_roles(racer=racer, groups=["t"]) == ["+teacher"]
    assert racer.quotas.get(name="learners").limit == 120
    assert apply_roles(racer=racer, groups=[]) == ["-teacher"]
    assert not racer.quotas.exists()


@pytest.mark.parametrize("limit", [0, 30, 500])
def test_a_quota_that_an_admin_has_set_stays(mapping, settings, limit):
    mapping("t=teacher")
    settings.LEARNERS_PER_TEACHER = 0
    racer = a_racer("alice")
    racer.quotas.create(name="learners", limit=limit)
    assert apply_roles(racer=racer, groups=["t"]) == apply_roles(racer=racer, groups=[]) == []
    assert racer.quotas.get().limit == limit


def test_a_role_never_lowers_the_sites_limit(mapping, settings):
    mapping("t=teacher,o=organiser")
    settings.LEARNERS_PER_TEACHER, settings.RACES_PER_RACER = 120, 400
    assert apply_roles(racer=a_racer("alice"), groups=["t", "o"]) == []


def test_groups_of_permissions(mapping):
    mapping("w=group:Writers")
    racer = a_racer("alice")
    racer.groups.add(Group.objects.create(name="By hand"))
    assert apply_roles(racer=racer, groups=["W"]) == ["+group:Writers"]
    assert {group.name for group in racer.groups.all()} == {"By hand", "Writers"}
    assert apply_roles(racer=racer, groups=[]) == ["-group:Writers"]
    assert {group.name for group in racer.groups.all()} == {"By hand"}
