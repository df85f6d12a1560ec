"""Boards through the API."""

from __future__ import annotations

import pytest
from django.utils import timezone

from accounts.models import Racer
from races.entries.services.entries import enter_race
from races.models import Visibility
from tests.factories import a_race, a_racer, drive, lap, laps

pytestmark = pytest.mark.django_db


@pytest.fixture
def now():
    return timezone.now()


def board(client, race, **query):
    return client.get(f"/api/v1/races/{race.slug}/board/", query)


def test_a_board_ranks_racers_marks_my_row_and_leaves_house_cars_out(alice, bob, charlie, now, as_racer):
    race = a_race(now)
    house = a_racer("house-car", is_house=True)
    drive(race, alice, laps(10_000, 10_000, 10_000), now)
    drive(race, house, laps(10_500, 10_500, 10_500), now)
    drive(race, bob, laps(11_000, 11_000, 11_000, resets=2), now)
    drive(race, charlie, [lap(1), lap(2, complete=False, percentage=40)], now)
    shown = board(as_racer(bob), race).json()
    assert [(row["racer"], row["rank"], row["gap_ms"]) for row in shown["results"]] == [
        ("alice", 1, 0),
        ("house-car", None, 500),
        ("bob", 2, 1000),
        ("charlie", None, None),
    ]
    assert [row["baseline"] for row in shown["results"]] == [False, True, False, False]
    assert [row["is_me"] for row in shown["results"]] == [False, False, True, False]
    assert (shown["count"], shown["classified_count"], shown["leader_ms"]) == (3, 2, 10_000)
    assert shown["my_row"] == shown["results"][2]
    assert shown["results"][0]["sector_colours"] == ["purple", "purple", "purple"]
    assert shown["results"][0]["has_fastest_lap"]
    assert all(row["evaluation"] for row in shown["results"])


def test_a_racer_without_a_result_is_last(alice, bob, now, as_racer):
    race = a_race(now)
    enter_race(race=race, racer=alice, now=now)
    drive(race, bob, laps(10_000, 10_000, 10_000), now)
    last = board(as_racer(alice), race).data["results"][-1]
    assert (last["racer"], last["rank"], last["evaluation"], last["submitted_at"]) == ("alice", None, None, None)


def test_a_paginated_board_pins_my_row(alice, now, as_racer):
    race = a_race(now)
    for number in range(4):
        drive(race, a_racer(), laps(*[10_000 + number] * 3), now)
    drive(race, alice, laps(20_000, 20_000, 20_000), now)
    client = as_racer(alice)
    first = board(client, race, page_size=2).data
    assert (first["page"], first["pages"], first["previous"]) == (1, 3, None)
    assert first["my_row"]["rank"] == 5
    ranks = [row["rank"] for row in first["results"]]
    address = first["next"]
    while address:
        page = client.get(address).data
        ranks += [row["rank"] for row in page["results"]]
        address = page["next"]
    assert ranks == [1, 2, 3, 4, 5]
    assert board(client, race, page=99, page_size=2).data["page"] == 3


@pytest.mark.parametrize("query", [{"page": 0}, {"page": "x"}, {"page_size": 0}, {"page_size": 101}])
def test_an_invalid_page_number_is_refused(now, as_racer, query):
    answer = board(as_racer(None), a_race(now), **query)
    assert (answer.status_code, answer.data["code"]) == (400, "invalid")


def test_a_longer_board_needs_no_more_queries(now, as_racer, django_assert_num_queries):
    race, client = a_race(now), as_racer(None)
    for count in (2, 6):
        while Racer.objects.count() < count:
            drive(race, a_racer(), laps(10_000, 10_000, 10_000), now)
        with django_assert_num_queries(4):  # the race twice: for the reader, and in the part that all share
            assert board(client, race).data["count"] == count


def test_a_board_is_visible_with_its_race(alice, bob, now, cast):
    race = a_race(now, organiser=alice, visibility=Visibility.INVITATION)
    cast["member"].post(f"/api/v1/invitations/{race.invitation}/")
    seen = {role: board(client, race).status_code for role, client in cast.items()}
    assert seen == {"owner": 200, "member": 200, "stranger": 404, "admin": 200, "anonymous": 404}


def test_the_api_and_the_page_serve_the_same_rows(alice, now, as_racer, client):
    race = a_race(now)
    drive(race, alice, laps(10_000, 10_000, 10_000), now)
    of_page = client.get(f"/races/{race.slug}/board.json").json()["rows"][0]
    of_api = board(as_racer(None), race).json()["results"][0]
    assert of_page.items() <= of_api.items()
