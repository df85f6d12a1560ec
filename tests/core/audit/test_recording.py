"""The audit log: one entry for each act, in its transaction, which nothing changes afterwards."""

from __future__ import annotations

import sys

import pytest
from django.db import DatabaseError, transaction
from django.utils import timezone

from accounts.tokens.services import create_token
from core.audit import triggers
from core.audit.models import AuditEntry
from core.audit.recording import audited
from paddock.errors import UserFault
from races.models import Race
from races.pages.services import cancel_race, edit_race
from tests.clients import logged_in
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db


@pytest.fixture
def as_command(monkeypatch) -> None:
    monkeypatch.setattr(sys, "argv", ["manage.py", "shell"])


@pytest.fixture
def entry(as_command, now) -> AuditEntry:
    cancel_race(race=a_race(now), reason="rain", now=now)
    return AuditEntry.objects.get()


def test_an_act_on_a_page_has_actor_channel_request_network_and_changes():
    alice = a_racer("alice")
    race = a_race(timezone.now(), organiser=alice)
    headers = {"x-request-id": "one-request"}
    answer = logged_in(alice).post(f"/races/{race.slug}/cancel/", {"reason": "rain"}, headers=headers)
    assert answer.status_code == 302
    entry = AuditEntry.objects.get()
    assert (entry.action, entry.actor, entry.channel) == ("race.cancelled", alice, "page")
    assert (entry.target_kind, entry.target_id, entry.target_name) == ("races.race", str(race.pk), race.slug)
    assert (entry.race, entry.request, entry.network) == (race.pk, "one-request", "127.0.0.0/24")
    assert entry.changes["cancel_reason"] == ["", "rain"]
    assert set(entry.changes) == {"cancel_reason", "cancelled_at"}


def test_an_act_by_the_api_names_its_token(client):
    alice = a_racer("alice")
    race = a_race(timezone.now(), organiser=alice)
    token, text = create_token(racer=alice, now=timezone.now())
    client.post(
        f"/api/v1/races/{race.slug}/cancel/",
        {"reason": "rain"},
        "application/json",
        headers={"authorization": f"Bearer {text}"},
    )
    entry = AuditEntry.objects.get()
    assert (entry.actor, entry.channel, entry.program) == (alice, "api", token.token_key)


def test_an_act_of_a_command_names_the_command(entry):
    assert (entry.actor, entry.channel, entry.program, entry.network) == (None, "command", "shell", "")


def test_what_tasks_do_is_no_act(now):
    cancel_race(race=a_race(now), reason="rain", now=now)
    assert not AuditEntry.objects.exists()


def test_a_request_that_is_over_acts_no_more(now):
    logged_in(a_racer("alice")).get("/races/")
    cancel_race(race=a_race(now), reason="rain", now=now)
    assert not AuditEntry.objects.exists()


def test_a_refused_act_leaves_no_entry(as_command, now):
    race = a_race(now)
    cancel_race(race=race, reason="rain", now=now)
    with pytest.raises(UserFault, match="cancelled"):
        cancel_race(race=race, reason="rain", now=now)
    assert AuditEntry.objects.count() == 1


def test_an_act_and_its_entry_are_one_transaction(as_command, now, monkeypatch):
    race = a_race(now)
    monkeypatch.setattr(AuditEntry.objects, "create", lambda **columns: 1 / 0)
    with pytest.raises(ZeroDivisionError), transaction.atomic():
        cancel_race(race=race, reason="rain", now=now)
    assert Race.objects.get(pk=race.pk).cancelled_at is None


def test_an_act_within_an_act_belongs_to_it(as_command, now):
    race = a_race(now)
    outer = audited("test.outer", "Outer", target="race")(lambda *, race: cancel_race(race=race, reason="x", now=now))
    outer(race=race)
    assert [one.action for one in AuditEntry.objects.all()] == ["test.outer"]


def test_secrets_and_long_texts_are_not_copied(as_command, now):
    race = a_race(now)
    edit_race(race=race, now=now, description="long " * 100, terms="Be fair.")
    changes = AuditEntry.objects.get().changes
    assert len(changes["description"][1]) == 200
    assert changes["terms"] is None


@pytest.mark.parametrize("write", ["update", "delete"])
def test_the_database_refuses_to_change_and_to_delete_entries(entry, write):
    rows = AuditEntry.objects.filter(pk=entry.pk)
    with pytest.raises(DatabaseError, match=triggers.MESSAGE), transaction.atomic():
        rows.update(action="nothing") if write == "update" else rows.delete()
    assert rows.get().action == entry.action


def test_entries_of_a_deleted_racer_keep_an_id_that_names_nobody():
    alice = a_racer("alice")
    race = a_race(timezone.now(), organiser=alice)
    logged_in(alice).post(f"/races/{race.slug}/cancel/", {"reason": "rain"})
    number = alice.pk
    Race.objects.all().delete()
    alice.delete()
    entry = AuditEntry.objects.select_related("actor").get()
    assert (entry.actor_id, entry.actor) == (number, None)


def test_changes_in_the_admin_site_are_entries_with_values(now):
    boss, bob = a_racer("boss", is_staff=True, is_superuser=True), a_racer("bob")
    client = logged_in(boss)
    form = client.get(f"/admin/accounts/racer/{bob.pk}/change/").context["adminform"].form
    sent = {name: value for name, value in form.initial.items() if isinstance(value, str | int) and value is not False}
    sent |= {"is_staff": "on", "email": "new@example.com", "joined_at_0": "2026-01-01", "joined_at_1": "00:00"}
    for inline in ("emailaddress_set", "authenticator_set", "quotas"):
        sent |= {f"{inline}-TOTAL_FORMS": 0, f"{inline}-INITIAL_FORMS": 0}
    assert client.post(f"/admin/accounts/racer/{bob.pk}/change/", sent).status_code == 302
    entry = AuditEntry.objects.get()
    assert (entry.action, entry.channel, entry.actor, entry.racer) == ("admin.changed", "admin", boss, bob)
    assert entry.changes["is_staff"] == [False, True]
    assert entry.changes["email"] is None
    assert entry.target_name == ""


def test_an_action_of_the_admin_site_is_one_entry():
    boss, race = a_racer("boss", is_staff=True, is_superuser=True), a_race(timezone.now())
    sent = {"action": "cancel", "_selected_action": race.pk, "reason": "rain"}
    logged_in(boss).post("/admin/races/race/", sent)
    assert [one.action for one in AuditEntry.objects.all()] == ["race.cancelled"]
