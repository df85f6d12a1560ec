"""Races of the league take any number of submissions unless they set a limit."""

from __future__ import annotations

from datetime import timedelta

import pytest

from league.models import StageRules
from league.seasons.services.seasons import set_stage_rules
from paddock.errors import UserFault
from races.entries.services.submissions import submit_model
from races.models import Entry, Race
from races.pages.services import create_community_race, create_league_race, edit_race
from tests.clients import logged_in
from tests.factories import a_model, a_racer, a_track, finish, laps
from tests.league.seasons import JANUARY, a_round, a_season

pytestmark = pytest.mark.django_db
HOUR = timedelta(hours=1)


@pytest.fixture(autouse=True)
def _alone(wakes: list[dict]) -> None:
    """No broker."""


def a_league_race(now, **options) -> Race:
    times = {"opens_at": now - HOUR, "closes_at": now + 99 * HOUR}
    return create_league_race(now=now, division="all", name="League", track=a_track(), **times, **options)


def test_a_league_race_is_unlimited_and_a_community_race_is_not(now):
    assert a_league_race(now).max_submissions is None
    assert a_league_race(now, max_submissions=3).max_submissions == 3
    times = {"opens_at": now, "closes_at": now + HOUR}
    made = create_community_race(organiser=a_racer(), now=now, name="Mine", track=a_track(), **times)
    assert made.max_submissions == 50
    open_ended = create_community_race(
        organiser=a_racer(), now=now, name="Mine", track=a_track(), max_submissions=None, **times
    )
    assert open_ended.max_submissions is None


def test_more_than_fifty_cars_are_taken_one_at_a_time(now, alice):
    race = a_league_race(now)
    first = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    Entry.objects.update(submission_count=1_234, last_number=1_234)
    with pytest.raises(UserFault) as refused:
        submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    assert refused.value.code == "submission_running", "turns stay fair"
    finish(first, laps(9_000, 9_000, 9_000), now + HOUR)
    with pytest.raises(UserFault) as refused:
        submit_model(race=race, racer=alice, model=first.evaluation.model, now=now + HOUR)
    assert refused.value.code == "car_already_submitted"
    second = submit_model(race=race, racer=alice, model=a_model(alice), now=now + HOUR)
    assert second.number == 1_235


def test_a_limit_is_an_option_of_a_race_and_of_a_stage(now):
    season = a_season()
    assert a_round(season, 1, "open-qualifier").race.max_submissions is None
    set_stage_rules(season=season, stage="open-qualifier", max_submissions=7)
    assert a_round(season, 2, "open-qualifier").race.max_submissions == 7
    set_stage_rules(season=season, stage="open-qualifier", max_submissions=None)
    race = a_round(season, 3, "open-qualifier").race
    assert race.max_submissions is None and StageRules.objects.get().max_submissions is None
    assert edit_race(race=race, now=JANUARY, max_submissions=9).max_submissions == 9
    assert edit_race(race=race, now=JANUARY, max_submissions=None).max_submissions is None


def test_pages_and_the_api_say_unlimited(now, alice, monkeypatch):
    monkeypatch.setattr("django.utils.timezone.now", lambda: now)
    race, client = a_league_race(now), logged_in(alice)
    finish(submit_model(race=race, racer=alice, model=a_model(alice), now=now), laps(9_000, 9_000, 9_000), now)
    a_model(alice)
    page = client.get(race.get_absolute_url()).content.decode()
    assert "unlimited" in page and "None" not in page.split("<main", 1)[1].split("<script")[0]
    assert 'name="model"' in page, "another car can be sent"
    assert "Submissions are unlimited" in client.get(f"{race.get_absolute_url()}rules/").content.decode()
    entry = client.get(f"/api/v1/races/{race.slug}/entry/").json()
    assert entry["submissions_left"] is None
    assert client.get(f"/api/v1/races/{race.slug}/").json()["max_submissions"] is None


def test_a_form_left_empty_sets_no_limit_and_a_season_says_so(client, now):
    from races.pages.forms import RaceForm

    form = RaceForm(now=now)
    assert form["max_submissions"].value() == 50
    season = a_season()
    set_stage_rules(season=season, stage="open-qualifier", laps=3)
    a_round(season, 1, "open-qualifier")
    assert "Submissions are unlimited." in client.get("/seasons/2027/rules/").content.decode()
