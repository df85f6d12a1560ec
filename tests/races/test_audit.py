"""Reading the audit log: pages, API, exports and the command."""

from __future__ import annotations

import csv
import io
import json
import re
import sys

import pytest
from django.core.management import call_command
from django.db import connection
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from accounts.models import Racer
from core.audit.models import AuditEntry
from races.audit.selectors import entries_visible_to
from races.models import Race
from races.pages.services import cancel_race, edit_race
from tests.clients import logged_in
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db


@pytest.fixture
def boss() -> Racer:
    return a_racer("boss", is_staff=True, is_superuser=True)


@pytest.fixture
def alice() -> Racer:
    return a_racer("alice")


@pytest.fixture
def race(alice) -> Race:
    return a_race(timezone.now(), organiser=alice, slug="of-alice")


@pytest.fixture
def entries(race, monkeypatch) -> list[AuditEntry]:
    """Four entries: two of alice's race, one of another's, one of a track."""
    now = timezone.now()
    monkeypatch.setattr(sys, "argv", ["manage.py", "shell"])
    edit_race(race=race, now=now, name="=HYPERLINK(1)")
    cancel_race(race=race, reason="rain", now=now)
    edit_race(race=a_race(now, slug="of-bob", organiser=a_racer("bob")), now=now, name="Other")
    AuditEntry.objects.create(action="track.deleted", channel="page", target_kind="tracks.track", target_name="oval")
    monkeypatch.undo()
    return list(AuditEntry.objects.order_by("pk"))


def test_readers_of_the_log_see_all_and_organisers_what_is_of_their_races(entries, boss, alice):
    seen = {None: [], boss: entries, alice: entries[:2], Racer.objects.get(alias="bob"): entries[2:3]}
    seen |= {a_racer("limited", is_staff=True): entries[:3], a_racer("stranger"): []}
    for viewer, expected in seen.items():
        assert set(entries_visible_to(viewer)) == set(expected), viewer


def test_organisers_see_the_acts_on_their_race_without_networks_and_tokens(entries, alice):
    AuditEntry.objects.create(
        action="race.changed", channel="api", program="sometoken", network="10.0.0.0/24", race=entries[0].race
    )
    html = logged_in(alice).get("/races/of-alice/audit/").content.decode()
    assert "Race cancelled" in html and "rain" in html
    assert "sometoken" not in html and "10.0.0.0" not in html
    assert html.count('id="entry-') == 3
    menu = html.partition('id="id_action"')[2].partition("</select>")[0]
    assert re.findall(r'value="([^"]*)"', menu) == ["", "race.cancelled", "race.changed"]


@pytest.mark.parametrize(
    ("query", "count"),
    [
        ("", 4),
        ("?action=race.cancelled", 1),
        ("?target=of-alice", 2),
        ("?target=tracks.track:", 1),
        ("?actor=nobody", 0),
        ("?actor=%231", 0),
        ("?since=2100-01-01", 0),
        ("?until=2000-01-01", 0),
        ("?since=2000-01-01&until=2100-01-01", 4),
    ],
)
def test_admins_filter_the_log(entries, boss, query, count):
    html = logged_in(boss).get(f"/audit/{query}").content.decode()
    assert html.count('id="entry-') == count


@pytest.mark.parametrize("query", ["?since=soon", "?action=none", "?before=x"])
def test_an_invalid_filter_is_refused(entries, boss, query):
    assert logged_in(boss).get(f"/audit/{query}").status_code == 422


def test_pages_follow_each_other_and_their_queries_do_not_grow(entries, boss):
    client = logged_in(boss)

    def queries() -> int:
        with CaptureQueriesContext(connection) as captured:
            assert client.get("/audit/").status_code == 200
        return len(captured)

    few = queries()
    for number in range(120):
        AuditEntry.objects.create(action="race.changed", channel="page", actor=boss, race=entries[0].race or number)
    assert queries() <= max(few, 8)
    seen, address = [], "/audit/"
    while address:
        page = client.get(address).context
        seen += [entry.pk for entry in page["page"].entries]
        address = f"/audit/?before={page['page'].older}" if page["page"].older else ""
    assert seen == [*AuditEntry.objects.order_by("-pk").values_list("pk", flat=True)]
    assert len(seen) == 124


def test_exports_have_every_entry_and_no_formula(entries, boss):
    client = logged_in(boss)
    text = b"".join(client.get("/audit/export/csv/?target=of-alice")).decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["action"] for row in rows] == ["race.changed", "race.cancelled"]
    AuditEntry.objects.create(action="x", channel="page", target_kind="x", target_name="=1+1")
    text = b"".join(client.get("/audit/export/csv/")).decode()
    assert list(csv.DictReader(io.StringIO(text)))[-1]["target_name"] == "'=1+1"
    lines = b"".join(client.get("/audit/export/jsonl/")).decode().splitlines()
    assert [json.loads(line)["id"] for line in lines] == [
        *AuditEntry.objects.order_by("pk").values_list("pk", flat=True)
    ]


def test_the_command_writes_the_same_as_the_export(entries, boss):
    out = io.StringIO()
    call_command("audit", "--format", "csv", "--action", "race.changed", stdout=out)
    exported = b"".join(logged_in(boss).get("/audit/export/csv/?action=race.changed")).decode()
    assert out.getvalue() == exported
    assert out.getvalue().count("race.changed") == 2


def test_the_api_lists_pages_of_the_log(entries, boss, alice):
    client = logged_in(boss)
    first = client.get("/api/v1/audit/?page_size=3").json()
    assert [one["action"] for one in first["results"]] == ["track.deleted", "race.changed", "race.cancelled"]
    second = client.get(first["next"]).json()
    assert [one["id"] for one in second["results"]] == [entries[0].pk]
    assert second["next"] is None
    own = logged_in(alice).get("/api/v1/races/of-alice/audit/").json()
    assert [one["action"] for one in own["results"]] == ["race.cancelled", "race.changed"]
    assert b"".join(client.get("/api/v1/audit/export/jsonl/?until=2000-01-01")) == b""


def test_the_name_of_a_deleted_actor_becomes_a_number(entries, boss):
    gone = a_racer("vanisher")
    number = gone.pk
    AuditEntry.objects.create(action="race.changed", channel="page", actor=gone)
    gone.delete()
    html = logged_in(boss).get(f"/audit/?actor=%23{number}").content.decode()
    assert f"#{number}</span>" in html
    assert "vanisher" not in html
