"""Seasons through the API: what they are, what is raced in them, who stands where."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from accounts.models import Racer
from league.models import Season
from league.seasons.services.seasons import set_stage_rules
from league.stewarding.official_results import close_round
from tests.factories import a_racer
from tests.kept import Kept
from tests.league.seasons import HOUR, a_round, a_season, after, board

pytestmark = pytest.mark.django_db


@pytest.fixture(scope="session")
def kept_season_of_ten(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, _make_season)


@pytest.fixture
def season(kept_season_of_ten: Kept, db: None) -> Season:
    return kept_season_of_ten.copy()


def _make_season() -> Season:
    """January's open race is official, February's and the pro race and its finale are to come."""
    made = a_season(drop_worst=1, prizes="A cup.")
    set_stage_rules(season=made, stage="open-qualifier", laps=5, minimum_laps=3)
    january = a_round(made, 1, "open-qualifier")
    cast = [a_racer(f"driver-{n}", country="KR" if n % 2 else "DE", team="Reds" if n < 4 else "") for n in range(1, 11)]
    board(january.race, cast)
    a_round(made, 2, "open-qualifier")
    a_round(made, 1, "pro-qualifier")
    a_round(made, 1, "pro-finale")
    close_round(round=january, now=after(january))
    return made


def get(client, path: str = "", **query):
    return client.get(f"/api/v1/seasons/2027/{path}", query)


def test_seasons_are_listed_latest_first(season, as_racer):
    answer = as_racer(None).get("/api/v1/seasons/").data
    assert (answer["count"], answer["pages"]) == (1, 1)
    assert dict(answer["results"][0]) == {
        "slug": "2027",
        "name": "2027",
        "starts_on": "2027-01-01",
        "ends_on": "2027-12-31",
        "races": 4,
        "official": 1,
        "topic": f"season:{season.pk}",
    }


def test_a_season_lists_its_settings_and_explains_them(season, as_racer):
    shown = get(as_racer(None)).data
    settings = ("promotion_percent", "finale_size", "championship_places", "points", "drop_worst", "prizes")
    assert [shown[name] for name in settings] == [20.0, 3, 2, [10, 6, 3, 1], 1, "A cup."]
    assert len(shown["rules"]) == 5 and "the best 20 %" in shown["rules"][0]
    assert [(one["stage"], one["laps"], one["minimum_laps"]) for one in shown["stage_rules"]] == [
        ("open-qualifier", 5, 3)
    ]
    assert "3 consecutive complete laps" in shown["stage_rules"][0]["ranking_rule"]
    assert shown["divisions"] == ["pro", "open"]


def test_rounds_are_listed_with_state_and_leader(season, as_racer):
    answer = get(as_racer(None), "rounds/").data
    assert [(one["number"], one["stage"]) for one in answer["results"]] == [
        (1, "open-qualifier"),
        (1, "pro-qualifier"),
        (1, "pro-finale"),
        (2, "open-qualifier"),
    ]
    first, second, *_rest = answer["results"]
    assert (first["leader"], first["month"], first["track"]) == ("driver-1", "Month 1", "oval")
    assert first["official_since"] and first["final_since"] > first["official_since"]
    assert (second["leader"], second["official_since"], second["final_since"]) == (None, None, None)
    assert {one["state"] for one in answer["results"]} == {"upcoming"}
    only = get(as_racer(None), "rounds/", stage="pro-finale").data
    assert (only["count"], only["results"][0]["stage"]) == (1, "pro-finale")
    page = get(as_racer(None), "rounds/", page=2, page_size=3).data
    assert (page["page"], page["pages"], len(page["results"])) == (2, 2, 1)


def test_standings_are_paginated(season, as_racer):
    client = as_racer(None)
    racers = get(client, "standings/", division="open").data
    assert [(one["place"], one["name"], one["country"], one["points"]) for one in racers["results"]] == [
        (1, "driver-1", "KR", 10),
        (2, "driver-2", "DE", 6),
        (3, "driver-3", "KR", 3),
        (4, "driver-4", "DE", 1),
    ]
    (cell,) = racers["results"][0]["rounds"]
    assert (cell["rank"], cell["points"], cell["dropped"]) == (1, 10, False)
    assert [
        (one["name"], one["points"])
        for one in get(client, "standings/", division="open", of="countries").data["results"]
    ] == [("KR", 13), ("DE", 7)]
    (team,) = get(client, "standings/", division="open", of="teams").data["results"]
    assert (team["name"].lower(), team["points"]) == ("reds", 19)
    assert get(client, "standings/").data["count"] == 0, "the pro division comes first, and nobody has raced in it"
    second = get(client, "standings/", division="open", page=2, page_size=3).data
    assert (second["pages"], [one["place"] for one in second["results"]]) == (2, [4])


def test_a_racers_season_lists_every_round_and_its_outcome(season, as_racer):
    shown = get(as_racer(None), "racers/Driver-2/").data
    assert (shown["racer"], shown["division"], shown["qualified_in"]) == ("driver-2", "pro", None)
    (row,) = shown["rounds"]
    assert shown["promoted_in"] == row["race"]
    assert (row["rank"], row["points"], row["score_ms"], row["official"]) == (2, 6, 31_000, True)
    assert (row["promoted"], row["in_finale"], row["qualified"]) == (True, False, False)
    assert shown["standings"] == {"open": {"place": 2, "points": 6}}
    last = get(as_racer(None), "racers/driver-10/").data
    assert (last["division"], last["promoted_in"], last["standings"]) == ("open", None, {})


@pytest.mark.parametrize(
    "path, query, status, code",
    [
        ("standings/", {"division": "amateur"}, 400, "invalid"),
        ("standings/", {"of": "cars"}, 400, "invalid"),
        ("rounds/", {"stage": "semi"}, 400, "invalid"),
        ("rounds/", {"page": "9"}, 404, "not_found"),
        ("racers/nobody/", {}, 404, "not_found"),
    ],
)
def test_unknown_seasons_and_racers_are_not_found(season, as_racer, path, query, status, code):
    answer = get(as_racer(None), path, **query)
    assert (answer.status_code, answer.data["code"]) == (status, code)
    assert as_racer(None).get(f"/api/v1/seasons/1999/{path}").status_code == 404
    assert as_racer(None).post("/api/v1/seasons/", {}).status_code == 401


def test_a_racer_who_left_has_no_season(season, as_racer):
    Racer.objects.filter(alias="driver-5").update(is_active=False)
    assert get(as_racer(None), "racers/driver-5/").status_code == 404


def test_more_racers_need_no_more_queries(season, as_racer, django_assert_max_num_queries):
    client = as_racer(None)
    board(season.rounds.get(number=2).race, [a_racer() for _ in range(40)])
    february = season.rounds.get(number=2)
    for pro in season.rounds.exclude(stage="open-qualifier"):
        pro.race.cancelled_at = pro.race.opens_at
        pro.race.cancel_reason = "Rain."
        pro.race.save()
    close_round(round=february, now=february.race.closes_at + HOUR)
    for path in ("", "rounds/", "standings/?division=open", "racers/driver-2/"):
        with django_assert_max_num_queries(12):
            assert client.get(f"/api/v1/seasons/2027/{path}").status_code == 200
    with django_assert_max_num_queries(3):
        client.get("/api/v1/seasons/")
