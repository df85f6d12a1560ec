"""One time zone on every page: the reader's, which the page names."""

from __future__ import annotations

import html
import re
from datetime import UTC, datetime, timedelta

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from core.forms import explain
from core.times import site_day, start_of_month
from league.models import Stage
from paddock.errors import UserFault
from tests.factories import a_race, a_racer, a_track
from tests.league.seasons import a_round, a_season
from tests.pages.conftest import World
from tests.pages.test_races import form
from tests.pages.test_season_form import NOW, open_round, short

SEOUL = "Asia/Seoul"


def reader(racer, zone: str = SEOUL) -> Client:
    client = Client()
    client.force_login(racer, "django.contrib.auth.backends.ModelBackend")
    client.cookies["zone"] = zone
    return client


def text(answer) -> str:
    return html.unescape(re.sub(r"<[^>]+>", " ", answer.content.decode()))


@pytest.fixture
def noon(monkeypatch: pytest.MonkeyPatch, wakes: list[dict]) -> datetime:
    monkeypatch.setattr("django.utils.timezone.now", lambda: NOW)
    return NOW


def english(moment: datetime) -> str:
    """A moment as English pages write it, without its zone."""
    year = "" if moment.year == NOW.year else f" {moment.year}"
    return f"{moment:%a} {moment.day} {moment:%b}{year}, {moment:%H:%M}"


@pytest.mark.django_db
def test_preview_race_form_and_calendar_have_the_same_time_zone(noon: datetime) -> None:
    boss = a_racer("boss", is_staff=True, is_superuser=True)
    client = reader(boss)
    a_track()
    preview = client.post("/seasons/new/", short(zone="America/New_York"))
    assert "Fri 1 Jan 2027, 14:00 KST" in text(preview)
    page = open_round(client, short(zone="America/New_York"), "1-open")
    assert 'value="2027-01-01T14:00"' in page.content.decode()
    assert re.search(r"Time zone *: *Asia/Seoul", text(page))
    season = a_season()
    one = a_round(season, 1, Stage.OPEN)
    opens = one.race.opens_at.astimezone(UTC) + timedelta(hours=9)
    calendar = client.get(reverse("season_calendar", args=[season.slug]))
    assert f"{english(opens)} KST" in text(calendar) and "Times in Asia/Seoul" in text(calendar)
    edit = client.get(reverse("race_edit", args=[one.race.slug]))
    assert f'value="{opens:%Y-%m-%dT%H:%M}"' in edit.content.decode()
    assert re.search(r"Time zone *: *Asia/Seoul", text(edit))
    admin = client.get(reverse("admin:races_race_change", args=[one.race.pk])).content.decode()
    assert f'value="{opens:%Y-%m-%d}"' in admin and f'value="{opens:%H:%M:%S}"' in admin


@pytest.mark.django_db
def test_a_race_is_saved_as_typed_in_the_readers_zone(world: World) -> None:
    client, race = reader(world.admin), world.upcoming
    opens, closes = (moment.astimezone(UTC) for moment in (race.opens_at, race.closes_at))
    sent = form(opens, opens_at=f"{opens + timedelta(hours=10):%Y-%m-%dT%H:%M}", time_zone="")
    sent["closes_at"] = f"{closes + timedelta(hours=10):%Y-%m-%dT%H:%M}"
    assert client.post(reverse("race_edit", args=[race.slug]), sent).status_code == 302
    race.refresh_from_db()
    assert race.opens_at == opens.replace(second=0, microsecond=0) + timedelta(hours=1)


@pytest.mark.django_db
def test_guests_of_two_zones_get_pages_of_their_own(noon: datetime) -> None:
    race = a_race(NOW, slug="here")
    seen = {}
    for zone in ("Asia/Seoul", "America/New_York", "nonsense", "../../etc/passwd"):
        client = Client()
        client.cookies["zone"] = zone
        seen[zone] = text(client.get(race.get_absolute_url()))
    closes = race.closes_at.astimezone(UTC)
    assert f"{english(closes + timedelta(hours=9))} KST" in seen["Asia/Seoul"]
    assert f"{english(closes - timedelta(hours=5))} EST" in seen["America/New_York"]
    assert f"{english(closes)} UTC" in seen["nonsense"] and f"{english(closes)} UTC" in seen["../../etc/passwd"]


def test_a_refusal_names_its_time_in_the_readers_zone(noon: datetime) -> None:
    fault = UserFault("race_not_open_yet", opens="2026-11-30 18:00 UTC")
    with timezone.override(SEOUL):
        assert "Tue 1 Dec, 03:00 KST" in explain(fault)
    assert "Mon 30 Nov, 18:00 UTC" in explain(fault)


def test_a_month_of_training_minutes_is_the_sites_month() -> None:
    late = datetime(2026, 11, 30, 20, tzinfo=UTC)
    with timezone.override(SEOUL):
        assert start_of_month(late) == datetime(2026, 11, 1, tzinfo=UTC)
        assert site_day(late).isoformat() == "2026-11-30"
