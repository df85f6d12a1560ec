"""What the log says of a changed form, and what a page says of fields that it did not take."""

from __future__ import annotations

import html
import re
from datetime import UTC, timedelta

import pytest
from django.contrib.admin.models import LogEntry
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from accounts.models import Racer, RacerGroup
from league.models import Season
from races.models import Race
from tests.factories import a_racer
from tests.league.seasons import a_season
from tests.pages.conftest import World
from tests.pages.test_races import form


def rendered(page: str) -> dict[str, object]:
    """What a browser sends of the largest form of a page when nobody changes anything."""
    form_ = max(re.findall(r"<form[^>]*method=\"post\".*?</form>", page, re.S), key=len)
    sent: dict[str, object] = {}
    for tag in re.findall(r"<input[^>]*>", form_):
        given = dict(re.findall(r'(\w+)="([^"]*)"', tag))
        name, kind = given.get("name"), given.get("type", "text")
        if not name or re.search(r"\bdisabled\b", tag) or kind in ("submit", "button", "file"):
            continue
        if kind in ("checkbox", "radio"):
            if "checked" in tag:
                sent.setdefault(name, [])
                sent[name].append(html.unescape(given.get("value", "on")))  # type: ignore[attr-defined]
            continue
        sent[name] = html.unescape(given.get("value", ""))
    for name, text in re.findall(r'<textarea name="([^"]*)"(?:(?!disabled)[^>])*>\n?(.*?)</textarea>', form_, re.S):
        sent[name] = html.unescape(text).replace("\r\n", "\n").replace("\n", "\r\n")
    for attributes, options in re.findall(r"<select([^>]*)>(.*?)</select>", form_, re.S):
        name = re.search(r'name="([^"]*)"', attributes)
        if name is None or "disabled" in attributes:
            continue
        chosen = re.findall(r'<option value="([^"]*)"[^>]*selected', options) or re.findall(r'value="([^"]*)"', options)
        if chosen and ("multiple" not in attributes or "selected" in options):
            sent[name[1]] = chosen[0]
    return sent


def said(client: Client, answer) -> str:
    assert answer.status_code == 302, answer.context["form"].errors if answer.context else answer.content
    return html.unescape(client.get(answer["Location"]).content.decode())


@pytest.mark.parametrize("which", ["open-race", "upcoming", "closed", "secret"])
def test_the_log_names_only_what_an_admin_has_changed(world: World, which: str) -> None:
    race = {"upcoming": world.upcoming, "closed": world.closed, "secret": world.secret}.get(which, world.race)
    Race.objects.filter(pk=race.pk).update(description="Two\nlines", closes_at=race.closes_at + timedelta(seconds=7))
    client = world.client("admin")
    address = reverse("race_edit", args=[race.slug])
    sent = rendered(client.get(address).content.decode())
    assert "Not changed" not in said(client, client.post(address, sent))
    assert not LogEntry.objects.exists()
    said(client, client.post(address, sent | {"name": "Another name", "edition": ""}))
    assert LogEntry.objects.get().change_message == "Edited: name"


def test_a_page_names_the_fields_that_it_did_not_take(world: World) -> None:
    client = world.client("alice")
    forged = form(
        timezone.now().astimezone(UTC), name="New name", laps="9", slug="other", division="pro", bots="3", kind="league"
    )
    page = said(client, client.post("/races/open-race/edit/", forged))
    told = re.search(r"Not changed, because this form cannot set it: ([^<]*)\.", page)
    assert told, page
    assert {"slug", "division", "kind", "laps"} <= set(told[1].split(", "))
    assert not {"name", "csrfmiddlewaretoken", "visibility"} & set(told[1].split(", "))


def test_a_new_race_names_the_fields_that_it_did_not_take(world: World) -> None:
    client = world.client("newcomer")
    sent = form(timezone.now().astimezone(UTC), organiser="alice", bots="3")
    page = said(client, client.post("/races/new/", sent))
    assert re.search(r"cannot set it: [^<]*organiser", page) and re.search(r"cannot set it: [^<]*bots", page)


def test_the_settings_name_the_fields_that_they_did_not_take(world: World) -> None:
    client = world.client("alice")
    sent = {"country": "KR", "alias": "queen", "is_staff": "1"}
    page = said(client, client.post(reverse("settings"), sent))
    told = re.search(r"cannot set it: ([^<]*)\.", page)
    assert told and set(told[1].split(", ")) == {"alias", "is_staff"}
    assert "cannot set it" not in said(client, client.post(reverse("settings"), {"country": "KR"}))


def admin_rows(world: World) -> dict[str, object]:
    season = a_season(prizes="A mug\nand a cap")
    group = RacerGroup.objects.create(name="Club", slug="club", description="Two\nlines", made_at=world.now)
    return {
        "races_race": world.upcoming,
        "league_season": season,
        "accounts_racergroup": group,
        "tracks_track": world.track,
        "accounts_racer": world.bob,
    }


@pytest.fixture
def boss(db: None) -> Client:
    client = Client()
    client.force_login(a_racer("boss", is_staff=True, is_superuser=True), "django.contrib.auth.backends.ModelBackend")
    return client


@pytest.mark.parametrize(
    "model", ["races_race", "league_season", "accounts_racergroup", "tracks_track", "accounts_racer"]
)
def test_the_admin_site_logs_no_field_that_nobody_changed(world: World, boss: Client, model: str) -> None:
    row = admin_rows(world)[model]
    address = reverse(f"admin:{model}_change", args=[row.pk])  # type: ignore[attr-defined]
    sent = rendered(boss.get(address).content.decode())
    answer = boss.post(address, sent | {"_continue": "1"})
    page = said(boss, answer)
    assert "cannot set it" not in page
    assert LogEntry.objects.latest("pk").get_change_message() == "No fields changed."


def test_the_admin_site_names_what_it_did_not_take(world: World, boss: Client) -> None:
    address = reverse("admin:league_season_change", args=[a_season().pk])
    sent = rendered(boss.get(address).content.decode()) | {"name": "New", "state": "over", "_continue": "1"}
    page = said(boss, boss.post(address, sent))
    assert re.search(r"cannot set it: state\.", page)
    assert LogEntry.objects.latest("pk").get_change_message() == "Changed Name."
    assert Season.objects.get().name == "New"
    racer = Racer.objects.get(alias="alice")
    address = reverse("admin:accounts_racer_change", args=[racer.pk])
    sent = rendered(boss.get(address).content.decode()) | {"alias": "queen", "_continue": "1"}
    assert re.search(r"cannot set it: alias\.", said(boss, boss.post(address, sent)))
