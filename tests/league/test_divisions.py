"""Divisions: who races where in a season."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from django.core.exceptions import ValidationError

from league.models import Membership, Round, Season
from league.seasons.selectors import standpoint_of
from league.seasons.services.seasons import create_season, put_in_division, schedule_round
from league.standings.selectors.boards import season_of
from races.entries.services.entries import enter_race
from races.entries.services.submissions import submit_model
from races.errors import RaceRefused
from tests.factories import a_model, a_race, a_racer, a_track
from tests.refusals import refused

pytestmark = pytest.mark.django_db


@pytest.fixture
def season(db) -> Season:
    return create_season(slug="2026", name="2026", starts_on=date(2026, 1, 1), ends_on=date(2026, 12, 31))


def november(season, division, now, number=1, **fields):
    times = {"opens_at": now - timedelta(days=10), "closes_at": now + timedelta(days=10)}
    return schedule_round(
        season=season,
        number=number,
        now=now,
        division=division,
        track=a_track(),
        **(times | {"name": f"November {division}"} | fields),
    ).race


def test_everybody_starts_in_the_open_division(season, alice, now):
    open_race, pro = november(season, "open", now), november(season, "pro", now)
    assert standpoint_of(season, alice).division == "open"
    assert enter_race(race=open_race, racer=alice, now=now)
    refused("race_pro_only", enter_race, race=pro, racer=alice, now=now)
    refused("race_pro_only", submit_model, race=pro, racer=alice, model=a_model(alice), now=now)


def test_a_pro_racer_enters_the_pro_race_and_no_other(season, alice, now):
    open_race, pro = november(season, "open", now), november(season, "pro", now)
    put_in_division(season=season, racer=alice, division="pro", now=now)
    assert submit_model(race=pro, racer=alice, model=a_model(alice), now=now)
    refused("race_open_only", enter_race, race=open_race, racer=alice, now=now)


def test_a_division_applies_to_one_season(season, alice, now):
    put_in_division(season=season, racer=alice, division="pro", now=now)
    following = create_season(slug="2027", name="2027", starts_on=date(2027, 1, 1), ends_on=date(2027, 12, 31))
    assert standpoint_of(following, alice).division == "open"
    race = november(following, "open", now)
    assert enter_race(race=race, racer=alice, now=now)


def test_community_races_and_house_cars_ignore_divisions(season, alice, now):
    put_in_division(season=season, racer=alice, division="pro", now=now)
    assert enter_race(race=a_race(now), racer=alice, now=now)
    house = a_racer(is_house=True)
    assert enter_race(race=november(season, "pro", now), racer=house, now=now).is_baseline


def test_nobody_may_enter_a_pro_race_outside_any_season(alice, now):
    race = a_race(now, kind="league", division="pro")
    assert season_of(race) is None
    refused("race_pro_only", enter_race, race=race, racer=alice, now=now)


def test_setting_a_racers_current_division_changes_nothing(season, alice, now):
    first = put_in_division(season=season, racer=alice, division="pro", now=now)
    again = put_in_division(season=season, racer=alice, division="pro", now=now + timedelta(days=1))
    assert again == first and again.since == now
    put_in_division(season=season, racer=alice, division="open", now=now)
    assert Membership.objects.get().division == "open"


def test_a_round_has_one_race_per_division(season, now):
    november(season, "open", now)
    november(season, "pro", now)
    november(season, "open", now, number=2, opens_at=now + timedelta(days=10), closes_at=now + timedelta(days=20))
    with pytest.raises(ValidationError) as caught:
        november(season, "open", now)
    assert "number" in caught.value.message_dict
    assert Round.objects.count() == 3 and season.rounds.count() == 3


def test_a_refused_race_leaves_no_round_behind(season, now):
    with pytest.raises(RaceRefused):
        november(season, "open", now, laps=2, minimum_laps=3)
    assert not Round.objects.exists()


def test_a_community_race_cannot_be_a_round(season, now):
    with pytest.raises(ValidationError) as caught:
        Round(season=season, number=1, race=a_race(now)).full_clean()
    assert "race" in caught.value.message_dict


def test_a_season_that_ends_before_it_starts_is_refused(db):
    with pytest.raises(ValidationError):
        create_season(slug="x", name="X", starts_on=date(2026, 2, 1), ends_on=date(2026, 1, 1))
