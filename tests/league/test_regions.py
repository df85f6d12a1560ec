"""Standings of regions: whose points make one, and what an operator may say instead."""

from __future__ import annotations

import pytest
from django.core.exceptions import ImproperlyConfigured
from django_countries import countries

from accounts.models import Racer
from accounts.profile.regions import USUAL, region_name, region_of, regions_in
from config.settings.env import env_regions
from league.standings.selectors.standings import season_standings, standings_among
from league.stewarding.official_results import close_round
from tests.factories import a_racer
from tests.league.seasons import a_round, a_season, after, board


def test_every_country_is_in_one_region_but_antarctica():
    listed = [code for codes in USUAL.values() for code in codes.split()]
    assert len(listed) == len(set(listed))
    assert {code for code, _name in countries} - set(listed) == {"AQ"}
    assert set(listed) <= {code for code, _name in countries}


@pytest.mark.django_db
def test_the_points_of_all_countries_of_a_region_add_up(client, settings):
    season = a_season()
    round_ = a_round(season, 1, "open-qualifier")
    cast = [a_racer(country=country) for country in ("KR", "JP", "DE", "")]
    board(round_.race, cast)
    close_round(round=round_, now=after(round_))
    assert [(line.holder, line.points) for line in season_standings(season, "open", "regions")] == [
        ("Asia", 16),
        ("Europe", 3),
    ]
    address = f"/seasons/{season.slug}/standings/?of=regions"
    page = client.get(address).content.decode()
    assert "Asia" in page and ">16<" in page
    assert "아시아" in client.get(address, headers={"Accept-Language": "ko"}).content.decode()
    settings.REGIONS = "Far & near: KR DE"
    assert [(line.holder, line.points) for line in season_standings(season, "open", "regions")] == [("Far & near", 13)]
    assert "Far &amp; near" in client.get(address).content.decode()
    assert client.get(f"/api/v1/seasons/{season.slug}/standings/?of=regions").json()["results"][0]["points"] == 13
    Racer.objects.update(country="FR")  # who moves takes nothing along
    assert season_standings(season, "open", "regions")[0].points == 13


@pytest.mark.django_db
def test_racers_of_a_region_have_standings_among_each_other(client, settings):
    season = a_season(points=[10, 5, 1])
    round_ = a_round(season, 1, "open-qualifier")
    cast = [
        a_racer(alias, country=country) for alias, country in (("kim", "KR"), ("ben", "DE"), ("jun", "JP"), ("dot", ""))
    ]
    board(round_.race, cast)
    close_round(round=round_, now=after(round_))
    lines = standings_among(season, "open", "Asia")
    assert [(line.place, line.holder, line.points) for line in lines] == [(1, cast[0].pk, 10), (2, cast[2].pk, 5)]
    assert standings_among(season, "open", "nowhere") == []
    address = f"/seasons/{season.slug}/standings/"
    assert '<a class="name" href="?region=Asia">Asia</a>' in client.get(f"{address}?of=regions").content.decode()
    page = client.get(f"{address}?region=Asia").content.decode()
    assert "the region's racers among each other" in page and '/racers/jun/"' in page
    assert '/racers/ben/"' not in page and 'href="?region=Europe"' in page
    assert '/racers/ben/"' in client.get(f"{address}?region=nonsense").content.decode(), "everybody"
    api = f"/api/v1{address}"
    found = client.get(f"{api}?region=Asia").json()["results"]
    assert [(row["name"], row["points"]) for row in found] == [("kim", 10), ("jun", 5)]
    assert client.get(f"{api}?region=nonsense").status_code == 400
    settings.REGIONS = "Far & near: KR DE"
    assert [row["name"] for row in client.get(f"{api}?region=Far+%26+near").json()["results"]] == ["kim", "ben"]


@pytest.mark.parametrize(
    "text", ["KR", "Asia:", ": KR", "Asia: KR; Asia: JP", "Asia: XX", "Asia: kr", "A: KR; B: KR", "A\nB: KR"]
)
def test_what_is_no_list_of_regions_is_refused(monkeypatch, text):
    monkeypatch.setenv("PADDOCK_REGIONS", text)
    with pytest.raises(ImproperlyConfigured, match="PADDOCK_REGIONS must be like"):
        env_regions("PADDOCK_REGIONS")


def test_a_list_is_read_with_blanks_and_commas(settings):
    assert regions_in(" One:KR,JP ;Two : DE;") == {"KR": "One", "JP": "One", "DE": "Two"}
    settings.REGIONS = ""
    assert (region_of("KR"), region_of("AQ"), region_of("")) == ("Asia", "", "")
    assert region_name("Elsewhere") == "Elsewhere"
