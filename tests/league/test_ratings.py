"""Ratings of a season: worked out from its duels, in a fixed order, shown to everybody."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from django.db import IntegrityError, transaction

from accounts.models import Racer
from core.events import follow
from league.models import DuelRating, Round, Season
from league.seasons.services.seasons import create_season
from league.standings.selectors.tables import racer_ratings, season_ratings
from league.standings.services import rate_season
from races.duels.services import draw_duels, drive_on
from races.entries.services.entries import remove_entry
from races.models import Entry, RaceKind
from tests.duels import a_duel_race, driving, end, qualify
from tests.duels import end_all as drive_all_heats
from tests.factories import a_racer

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _commits(wakes, monkeypatch):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


@pytest.fixture
def season() -> Season:
    return create_season(slug="2026", name="2026", starts_on=date(2026, 1, 1), ends_on=date(2026, 12, 31))


@pytest.fixture
def racers() -> list[Racer]:
    return [a_racer(f"car-{number}") for number in range(1, 4)]


def a_round(season: Season, racers: list[Racer], now, number: int = 1, **fields):
    """A drawn league race of duels that is a round of the season."""
    race = a_duel_race(now, kind=RaceKind.LEAGUE, division="open", **fields)
    qualify(race, racers, now)
    Round.objects.create(season=season, number=number, race=race)
    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    return race


def end_all(race, now, **how) -> None:
    """Drive all heats, and let the season follow."""
    drive_all_heats(race, now, **how)
    follow("seasons", now=now)


def table(season: Season) -> list[tuple]:
    return [(one.place, one.racer.alias, one.duels) for one in season_ratings(season)]


def kept(season: Season) -> list[tuple]:
    return list(DuelRating.objects.filter(season=season).order_by("racer").values_list("racer", "mu", "sigma", "duels"))


def test_ratings_are_written_with_the_last_duel_of_a_race(season, racers, now):
    race = a_round(season, racers, now)
    first = driving(race)
    for duel in first:
        end(duel, now, winners=None)
    assert not DuelRating.objects.exists()
    end_all(race, now, choose=max)
    assert [alias for _, alias, _ in table(season)] == ["car-3", "car-2", "car-1"]
    assert {duels for *_, duels in table(season)} == {4}


def test_ratings_carry_over_from_race_to_race(season, racers, now):
    end_all(a_round(season, racers, now), now, choose=max)
    before = season_ratings(season)[0].shown
    end_all(a_round(season, racers, now + timedelta(days=1), number=2), now, choose=max)
    after = season_ratings(season)[0]
    assert (after.racer.alias, after.duels) == ("car-3", 8) and after.shown > before > 0


def test_recomputed_ratings_are_the_same(season, racers, now):
    end_all(a_round(season, racers, now), now, choose=max)
    end_all(a_round(season, racers, now + timedelta(days=1), number=2), now, choose=min)
    before = kept(season)
    assert rate_season(season=season) == 3
    assert kept(season) == before


def test_ratings_do_not_depend_on_which_race_ended_first(season, racers, now):
    early = a_round(season, racers, now)
    late = a_round(season, racers, now + timedelta(days=1), number=2)
    end_all(late, now, choose=min)
    end_all(early, now, choose=max)
    other = create_season(slug="2025", name="2025", starts_on=date(2025, 1, 1), ends_on=date(2025, 12, 31))
    end_all(a_round(other, racers, now + timedelta(days=2)), now, choose=max)
    end_all(a_round(other, racers, now + timedelta(days=3), number=2), now, choose=min)
    assert kept(season) == kept(other)


def test_community_races_are_not_rated(season, racers, now):
    race = a_duel_race(now)
    qualify(race, racers, now)
    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    end_all(race, now)
    assert not DuelRating.objects.exists()


def test_walkovers_are_not_rated(season, racers, now):
    race = a_round(season, racers[:2], now)
    remove_entry(entry=Entry.objects.get(race=race, seed=2), by=a_racer("sam", is_staff=True), now=now)
    assert not DuelRating.objects.exists() and season_ratings(season) == []


def test_a_racers_page_shows_their_rating_in_each_season(client, season, racers, now):
    end_all(a_round(season, racers, now), now, choose=max)
    (rating,) = racer_ratings(racers[2])
    assert (rating.place, rating.season) == (1, season)
    html = client.get("/racers/car-3/").content.decode()
    assert "Rating in duels" in html and f"{rating.shown:.1f}" in html and "place 1" in html
    assert "4 points" in html, "in the list of races"
    assert "Rating in duels" not in client.get(a_racer("newcomer").get_absolute_url()).content.decode()


def test_a_racer_has_one_rating_per_season(season, racers, now):
    DuelRating.objects.create(season=season, racer=racers[0], mu=25, sigma=8, duels=1)
    with pytest.raises(IntegrityError), transaction.atomic():
        DuelRating.objects.create(season=season, racer=racers[0], mu=25, sigma=8, duels=1)
    with pytest.raises(IntegrityError), transaction.atomic():
        DuelRating.objects.create(season=season, racer=racers[1], mu=25, sigma=0, duels=1)


def test_only_duels_of_a_round_show_ratings(client, season, racers, now):
    race = a_round(season, racers, now)
    assert "Rating in duels" not in client.get(f"/races/{race.slug}/duels/").content.decode()
    end_all(race, now, choose=max)
    html = client.get(f"/races/{race.slug}/duels/").content.decode()
    card = html[html.index("Rating in duels") :]
    assert card.index(">car-3</a>") < card.index(">car-2</a>") < card.index(">car-1</a>")
    other = a_duel_race(now)
    assert "Rating in duels" not in client.get(f"/races/{other.slug}/duels/").content.decode()


def test_equal_ratings_share_a_place(season, racers):
    for racer, mu in zip(racers, (25, 30, 25), strict=True):
        DuelRating.objects.create(season=season, racer=racer, mu=mu, sigma=5, duels=1)
    assert table(season) == [(1, "car-2", 1), (2, "car-1", 1), (2, "car-3", 1)]
    assert [one.place for one in season_ratings(season, 2)] == [1, 2]
    assert [one.place for one in racer_ratings(racers[2])] == [2]
