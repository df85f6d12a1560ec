"""Duels through the API."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import transaction
from django.utils import timezone

from races.entries.services.entries import accept_invitation
from races.models import Draw, Duel, Visibility
from tests.duels import a_duel_race, drawn, driving, end, end_all, qualify
from tests.factories import a_race, a_racer

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _commits(monkeypatch):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


@pytest.fixture
def now():
    return timezone.now() - timedelta(days=1)


def address(race) -> str:
    return f"/api/v1/races/{race.slug}/duels/"


def test_before_the_draw_there_are_no_heats(as_racer):
    shown = as_racer(None).get(address(a_duel_race(timezone.now(), duel_cars=3))).json()
    assert shown["drawn_at"] is None and shown["heats"] == []
    assert (shown["duel_format"], shown["duel_cars"], shown["entrants"], shown["total"]) == ("round_robin", 3, 0, 0)


def test_a_heat_lists_its_grid_and_its_outcome(now, as_racer):
    race = drawn(now, 2)
    (duel,) = driving(race)
    end(duel, now, winners=[2, 1], times={1: [11_000] * 3, 2: [10_000] * 3}, retired=[1])
    shown = as_racer(None).get(address(race)).json()
    assert (shown["decided"], shown["total"], shown["entrants"]) == (1, 2, 2)
    first, second = shown["heats"]
    assert (first["round"], first["number"], first["state"]) == (1, 1, "decided")
    assert first["evaluation"] == duel.evaluation.public_id
    assert first["cars"][0] == {
        "grid": 1,
        "racer": "car-1",
        "seed": 1,
        "place": 2,
        "points": 0,
        "laps": 2,
        "time_ms": 22_000,
        "forfeited": False,
        "retired_code": "non_finite_action",
    }
    assert (second["state"], second["cars"][0]["racer"], second["cars"][0]["place"]) == ("driving", "car-2", None)


def test_the_board_has_seeds_points_and_the_average_lap(now, as_racer):
    race = drawn(now, 3)
    before = as_racer(None).get(f"/api/v1/races/{race.slug}/board/").json()
    assert [(row["seed"], row["points"], row["duel_lap_ms"]) for row in before["results"]] == [
        (1, 0, None),
        (2, 0, None),
        (3, 0, None),
    ]
    end_all(race, now, choose=max)
    after = as_racer(None).get(f"/api/v1/races/{race.slug}/board/").json()
    assert [(row["rank"], row["racer"], row["seed"], row["points"], row["duels"]) for row in after["results"]] == [
        (1, "car-3", 3, 4, 4),
        (2, "car-2", 2, 2, 4),
        (3, "car-1", 1, 0, 4),
    ]
    assert (after["leader_ms"], after["results"][1]["gap_ms"]) == (None, None)


def test_a_race_without_duels_has_no_duels(now, as_racer):
    answer = as_racer(None).get(address(a_race(now)))
    assert (answer.status_code, answer.json()["code"]) == (404, "race_has_no_duels")


def test_the_organiser_draws_the_duels(now, alice, cast):
    race = a_duel_race(now, organiser=alice)
    qualify(race, [a_racer(), a_racer()], now)
    for _ in range(2):
        answer = cast["owner"].post(address(race))
        assert answer.status_code == 200 and answer.json()["entrants"] == 2
    assert Duel.objects.count() == 2


@pytest.mark.parametrize(
    ("role", "status"), [("owner", 200), ("admin", 200), ("member", 403), ("stranger", 403), ("anonymous", 401)]
)
def test_only_the_organiser_and_admins_may_draw(now, alice, bob, cast, role, status):
    race = a_duel_race(now, organiser=alice)
    qualify(race, [bob, a_racer()], now)
    assert cast[role].post(address(race)).status_code == status
    assert Draw.objects.exists() == (status == 200)


@pytest.mark.parametrize(
    ("role", "status"), [("owner", 200), ("admin", 200), ("member", 200), ("stranger", 404), ("anonymous", 404)]
)
def test_only_members_see_the_duels_of_an_invitation_race(now, alice, bob, cast, role, status):
    race = a_duel_race(now, organiser=alice, visibility=Visibility.INVITATION)
    accept_invitation(token=race.invitation, racer=bob, now=now)
    assert cast[role].get(address(race)).status_code == status


@pytest.mark.parametrize(
    ("role", "status"), [("owner", 200), ("admin", 200), ("member", 200), ("stranger", 404), ("anonymous", 404)]
)
def test_only_members_see_one_duel_of_an_invitation_race(now, alice, bob, cast, role, status):
    race = a_duel_race(now, organiser=alice, visibility=Visibility.INVITATION)
    racers = [bob, a_racer()]
    for racer in racers:
        accept_invitation(token=race.invitation, racer=racer, now=now)
    qualify(race, racers, now)
    cast["owner"].post(address(race))
    (duel,) = driving(race)
    end(duel, now)
    assert cast[role].get(f"/api/v1/evaluations/{duel.evaluation.public_id}/").status_code == status


def test_drawing_before_the_close_is_refused(alice, cast):
    answer = cast["owner"].post(address(a_duel_race(timezone.now(), organiser=alice)))
    assert (answer.status_code, answer.json()["code"]) == (409, "duels_before_closing")


def test_a_racer_cannot_stop_a_duel(now, as_racer):
    race = drawn(now, 2)
    (duel,) = driving(race)
    answer = as_racer(duel.evaluation.owner).post(f"/api/v1/evaluations/{duel.evaluation.public_id}/stop/")
    assert answer.status_code in (403, 404)
    duel.evaluation.refresh_from_db()
    assert duel.evaluation.state == "queued"
