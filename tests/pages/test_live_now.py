"""Home, race and season tell of live events: what is on track, who is next, and where to watch."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone

from races.live.selectors.events import live_now
from races.live.services import launch, plan_live
from races.models import Visibility
from tests.factories import a_race, a_racer
from tests.league.seasons import a_season
from tests.live_shows import a_live_race, a_show, begun, compute, slot_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def event(wakes):
    now, alice = timezone.now(), a_racer("alice")
    race = a_live_race(now, alice, name="Race night", slug="race-night")
    event = begun(a_show(now, alice, ["bob", "carl"], race=race, order="as_entered"), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    launch(event=event, by=alice, seen=None, now=now, slot=slot_of(event, "bob"))
    return event


def test_pages_lead_to_what_is_live_and_say_who_drives_and_who_is_next(event):
    for path in ("/", "/races/race-night/"):
        shown = Client().get(path).content.decode()
        part = shown.partition('id="on-track"')[2].partition("</section>")[0]
        assert 'href="/races/race-night/event/"' in part, path
        assert "bob" in part and "carl" in part, path


def test_a_season_tells_of_its_own_alone(event):
    season = a_season()
    assert b"/races/race-night/event/" not in Client().get(season.get_absolute_url()).content


def test_what_comes_within_a_day_is_told_and_what_comes_later_is_not(wakes):
    now, alice = timezone.now(), a_racer("alice")
    for name, hours in (("soon", 20), ("later", 30)):
        race = a_race(now, organiser=alice, slug=name, closes_at=now + timedelta(days=9))
        plan_live(race=race, by=alice, now=now, starts_at=now + timedelta(hours=hours))
    assert [each.event.race.slug for each in live_now(None, now)] == ["soon"]


def test_a_private_one_is_told_of_to_those_who_may_see_it(event):
    type(event.race).objects.filter(pk=event.race_id).update(visibility=Visibility.INVITATION)
    now, bob = timezone.now(), event.race.entries.first().racer
    assert live_now(None, now) == [] == live_now(a_racer("stranger"), now)
    assert [each.event for each in live_now(bob, now)] == [event]


def test_where_nothing_is_live_one_query_says_so(wakes, django_assert_num_queries):
    with django_assert_num_queries(1):
        assert live_now(None, timezone.now()) == []


def test_the_plan_of_a_live_event_gives_seconds_and_the_order(wakes):
    now, alice = timezone.now(), a_racer("alice")
    race = a_live_race(now, alice, name="Race night", slug="race-night")
    a_show(now, alice, ["bob"], race=race, order="slowest_first")
    page = Client().get("/races/race-night/event/").content.decode()
    assert "s each · slowest first" in page and "qualifier" not in page
    page = Client(HTTP_ACCEPT_LANGUAGE="ko").get("/races/race-night/event/").content.decode()
    assert "초 · 느린 순" in page


def test_the_big_screen_gives_the_start_in_the_time_zone_of_the_event(wakes):
    now, alice = timezone.now(), a_racer("alice")
    race = a_live_race(now, alice, name="Race night", slug="race-night")
    event = a_show(now, alice, ["bob"], race=race)
    type(event).objects.filter(pk=event.pk).update(time_zone="Asia/Seoul")
    page = Client().get("/races/race-night/live/screen/").content.decode()
    assert "KST</time>" in page
