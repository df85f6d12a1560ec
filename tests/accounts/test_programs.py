"""Accounts of programs: tokens, an owner, no sessions, no races."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.contrib.auth import authenticate
from django.test import Client
from django.utils import timezone

from accounts.models import Racer, ServiceAccount
from accounts.programs.services import (
    change_program,
    disable_programs_of,
    make_program,
    make_program_token,
    programs,
    replace_program_token,
    revoke_program_token,
    switch_program,
)
from accounts.signing_in.reserved_aliases import is_reserved
from accounts.tokens.services import tokens_of
from core.audit.models import AuditEntry
from paddock.errors import UserFault
from races.entries.services.entries import enter_race
from tests.clients import logged_in
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db


@pytest.fixture
def boss() -> Racer:
    return a_racer("boss", is_staff=True, is_superuser=True)


@pytest.fixture
def program(boss) -> ServiceAccount:
    a_racer("alice")
    return make_program(by=boss, name="ci", purpose="Nightly results", owner="alice", now=timezone.now())


def token_for(program: ServiceAccount, boss: Racer, *scopes: str) -> str:
    return make_program_token(program=program, by=boss, scopes=scopes, days=7, now=timezone.now())[1]


def me(text: str) -> int:
    return Client().get("/api/v1/me/", headers={"authorization": f"Bearer {text}"}).status_code


def test_a_program_has_an_alias_of_its_kind_an_owner_and_no_password(program):
    assert program.racer.alias == "program-ci"
    assert (program.racer.is_program, program.racer.has_usable_password()) == (True, False)
    assert str(program.owner) == "alice"
    assert is_reserved("program-other") and is_reserved("Program_x")


def test_a_program_uses_the_api_within_its_scopes(program, boss):
    text = token_for(program, boss, "read")
    headers = {"authorization": f"Bearer {text}"}
    assert Client().get("/api/v1/me/", headers=headers).json()["alias"] == "program-ci"
    refused = Client().patch("/api/v1/me/", {"team": "x"}, "application/json", headers=headers)
    assert (refused.status_code, refused.json()["code"]) == (403, "scope_missing")
    assert programs().get().last_used_at is not None


def test_a_program_never_signs_in_not_even_with_a_password(program, client):
    racer = program.racer
    racer.set_password("a password of 20 characters")
    racer.save()
    assert authenticate(None, username="program-ci", password="a password of 20 characters") is None
    client.force_login(racer, backend="accounts.backends.PasswordBackend")
    assert client.get("/settings/").status_code == 302


def test_a_program_cannot_enter_a_race(program, now):
    with pytest.raises(UserFault) as refused:
        enter_race(race=a_race(now), racer=program.racer, now=now)
    assert refused.value.code == "race_program"


def test_a_disabled_program_is_refused_until_it_is_enabled(program, boss):
    text = token_for(program, boss, "read")
    switch_program(program=program, by=boss, active=False)
    assert me(text) == 401
    with pytest.raises(UserFault) as refused:
        token_for(program, boss, "read")
    assert refused.value.code == "program_disabled"
    switch_program(program=program, by=boss, active=True)
    assert me(text) == 200


def test_the_programs_of_a_deactivated_owner_are_disabled(program, boss):
    text = token_for(program, boss, "read")
    sent = {"action": "deactivate", "_selected_action": program.owner.pk}
    logged_in(boss).post("/admin/accounts/racer/", sent)
    assert me(text) == 401
    program = programs().get()
    with pytest.raises(UserFault, match="must be an active racer"):
        switch_program(program=program, by=boss, active=True)
    assert disable_programs_of(owner=program.owner) == 0


def test_a_replaced_token_has_the_scopes_of_the_old_one_which_is_void(program, boss):
    old = token_for(program, boss, "read", "race")
    key = tokens_of(program.racer, timezone.now()).get().token_key
    made = replace_program_token(program=program, by=boss, key=key, days=30, now=timezone.now())
    assert made is not None and made[0].grant.scopes == ["read", "race"]
    assert made[0].expiry > timezone.now() + timedelta(days=29)
    assert (me(old), me(made[1])) == (401, 200)
    assert replace_program_token(program=program, by=boss, key=key, days=30, now=timezone.now()) is None
    assert revoke_program_token(program=program, by=boss, key=made[0].token_key)
    assert me(made[1]) == 401


@pytest.mark.parametrize("owner", ["nobody", "program-ci", "gone"])
def test_the_owner_is_an_active_racer(program, boss, owner):
    a_racer("gone", is_active=False)
    with pytest.raises(UserFault, match="must be an active racer"):
        change_program(program=program, by=boss, owner=owner)


def test_only_admins_with_the_permission_manage_programs(program, boss):
    for by in (a_racer("bob"), a_racer("limited", is_staff=True), program.racer):
        with pytest.raises(UserFault, match="admins with the permission"):
            make_program(by=by, name="other", purpose="x", owner="alice", now=timezone.now())
    with pytest.raises(UserFault, match="account of this name"):
        make_program(by=boss, name="CI", purpose="x", owner="alice", now=timezone.now())


def test_pages_make_a_program_show_its_token_once_and_log_all_of_it(boss):
    a_racer("alice")
    client = logged_in(boss)
    sent = {"name": "ci", "purpose": "Nightly", "owner": "alice"}
    page = client.post("/programs/", sent, follow=True)
    assert page.redirect_chain == [("/programs/program-ci/", 302)]
    session = client.session
    session["account_authentication_methods"] = [{"method": "password", "at": timezone.now().timestamp()}]
    session.save()
    page = client.post("/programs/program-ci/", {"action": "create", "scopes": ["read"], "days": "7"})
    text = page.context["token"]
    assert me(text) == 200
    assert text not in client.get("/programs/program-ci/").content.decode()
    tokens = tokens_of(Racer.objects.get(alias="program-ci"), timezone.now()).values_list("token_key", flat=True)
    for action in ("replace", "revoke", "disable", "enable"):
        client.post("/programs/program-ci/", {"action": action, "key": tokens.first() or ""})
    acts = [*AuditEntry.objects.order_by("pk").values_list("action", flat=True)]
    names = ("created", "token_created", "token_replaced", "token_revoked", "disabled", "enabled")
    assert acts == [f"program.{name}" for name in names]


def test_the_api_makes_changes_and_rotates(boss):
    a_racer("alice"), a_racer("bob")
    client = logged_in(boss)
    sent = {"name": "ci", "purpose": "Nightly", "owner": "alice"}
    assert client.post("/api/v1/programs/", sent, "application/json").json()["alias"] == "program-ci"
    token = client.post("/api/v1/programs/program-ci/tokens/", {"days": 3}, "application/json").json()
    assert (token["scopes"], me(token["token"])) == (["read"], 200)
    new = client.post(f"/api/v1/programs/program-ci/tokens/{token['key']}/", {}, "application/json").json()
    assert (me(token["token"]), me(new["token"])) == (401, 200)
    changed = client.patch("/api/v1/programs/program-ci/", {"active": False, "owner": "bob"}, "application/json").json()
    assert (changed["active"], changed["owner"], len(changed["tokens"])) == (False, "bob", 1)
    assert me(new["token"]) == 401
    assert client.delete(f"/api/v1/programs/program-ci/tokens/{new['key']}/").status_code == 204
    assert [one["alias"] for one in client.get("/api/v1/programs/").json()["results"]] == ["program-ci"]
