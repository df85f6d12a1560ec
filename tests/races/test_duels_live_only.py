"""Closing a race of duels: what becomes of a live bracket, planned or still to be planned."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from races.duels.services import draw_duels, drive_all_on
from races.live.services import begin_live, plan_live
from races.models import Draw, Duel, DuelState, LiveEvent, LiveSlot, Race, RaceKind
from races.pages.services import close_race, edit_race
from tests.clients import logged_in
from tests.duels import a_duel_race, qualify
from tests.factories import a_racer

pytestmark = pytest.mark.django_db
HOUR = timedelta(hours=1)


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def now():
    return timezone.now()


def a_field(now, alice, **fields):
    """An open race of duels that four cars have qualified for."""
    race = a_duel_race(now, organiser=alice, **({"duel_format": "bracket"} | fields))
    qualify(race, [a_racer(f"car-{number}") for number in range(1, 5)], now)
    return race


def queued(race):
    return Duel.objects.filter(race=race).exclude(state=DuelState.WAITING).count()


def test_a_race_that_draws_only_live_waits_for_its_live_event(alice, now):
    race = close_race(race=a_field(now, alice, duels_live_only=True), now=now)
    for hours in (1, 24, 24 * 7):
        assert drive_all_on(now=now + hours * HOUR) == 0
    assert not Draw.objects.filter(race=race).exists()
    event = plan_live(race=race, by=alice, now=now + 24 * HOUR, starts_at=now + 25 * HOUR)
    begin_live(event=event, by=alice, seen=None, now=now + 25 * HOUR)
    assert Draw.objects.get(race=race).entrants == 4
    assert drive_all_on(now=now + 26 * HOUR) == 0
    assert (queued(race), LiveSlot.objects.filter(event=event).count()) == (0, 4)


def test_its_organiser_may_draw_it_by_hand(alice, now):
    race = close_race(race=a_field(now, alice, duels_live_only=True), now=now)
    draw_duels(race=race, now=now + HOUR)
    assert drive_all_on(now=now + HOUR) > 0


@pytest.mark.parametrize("live_only", [False, True])
def test_closing_keeps_a_planned_bracket(alice, now, live_only):
    race = a_field(now, alice, duels_live_only=live_only)
    event = plan_live(race=race, by=alice, now=now, starts_at=race.closes_at + HOUR)
    close_race(race=race, now=now)
    assert drive_all_on(now=now + HOUR / 2) == 0
    assert queued(race) == 0
    begin_live(event=event, by=alice, seen=None, now=event.starts_at)
    assert LiveSlot.objects.filter(event=event).count() == 4


def test_the_page_warns_and_offers_to_plan_the_live_event(alice, now):
    race = a_field(now, alice)
    client, address = logged_in(alice), reverse("race_close", args=[race.slug])
    page = client.get(address).content.decode()
    assert "No live event is planned." in page
    assert 'name="duels" value="live"' in page
    answer = client.post(address, {"duels": "live"})
    assert answer.url == reverse("live_plan", args=[race.slug])
    race.refresh_from_db()
    assert race.closes_at <= timezone.now()
    assert race.duels_live_only
    assert drive_all_on(now=now + HOUR) == 0
    assert not Draw.objects.filter(race=race).exists()
    starts = timezone.now() + timedelta(days=1)
    sent = {"starts_at": f"{starts:%Y-%m-%dT%H:%M}", "time_zone": "UTC", "rounds": 1, "attempt_ms": 60}
    assert client.post(answer.url, sent | {"order": "as_entered", "gap_s": 5}).status_code == 302
    assert LiveEvent.objects.filter(race=race).exists()


def test_a_league_race_of_duels_warns_too(alice, now):
    race = a_field(now, alice)
    Race.objects.filter(pk=race.pk).update(kind=RaceKind.LEAGUE, division="open")
    page = logged_in(alice).get(reverse("race_close", args=[race.slug])).content.decode()
    assert "The results become official" in page
    assert "No live event is planned." in page


def test_without_a_wish_the_duels_are_driven_at_once(alice, now):
    race = a_field(now, alice)
    logged_in(alice).post(reverse("race_close", args=[race.slug]))
    assert drive_all_on(now=timezone.now()) > 0


def test_nothing_is_warned_of_where_nothing_is_lost(alice, now):
    planned, only = a_field(now, alice), a_duel_race(now, organiser=alice, duels_live_only=True)
    plan_live(race=planned, by=alice, now=now, starts_at=planned.closes_at + HOUR)
    for race, words in ((planned, "driven in the live event"), (only, "The duels are not drawn")):
        page = logged_in(alice).get(reverse("race_close", args=[race.slug])).content.decode()
        assert words in page
        assert "No live event is planned." not in page


def test_a_program_closes_likewise(alice, now):
    race = a_field(now, alice)
    address = f"/api/v1/races/{race.slug}/close/"
    answer = logged_in(alice).post(address, {"duels_live_only": True}, "application/json")
    assert (answer.status_code, answer.json()["duels_live_only"]) == (200, True)
    assert drive_all_on(now=timezone.now()) == 0


def test_the_option_may_change_until_the_race_closes(alice, now):
    race = edit_race(race=a_field(now, alice), now=now, duels_live_only=True)
    assert race.duels_live_only
    page = logged_in(alice).get(reverse("race_edit", args=[race.slug])).content.decode()
    assert 'name="duels_live_only"' in page


def test_the_duels_tab_tells_the_organiser_in_time(alice, now):
    race = a_field(now, alice)
    address = reverse("race_duels", args=[race.slug])
    assert "plan the live event before the race closes" in logged_in(alice).get(address).content.decode()
    assert "plan the live event before the race closes" not in logged_in(None).get(address).content.decode()
    close_race(race=edit_race(race=race, now=now, duels_live_only=True), now=now)
    page = logged_in(alice).get(address).content.decode()
    assert "drawn when the live event begins" in page
    assert "Draw now" in page
