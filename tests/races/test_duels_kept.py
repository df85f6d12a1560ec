"""What the database keeps of duels and refuses, and what admins see of them."""

from __future__ import annotations

import pytest
from django.db import IntegrityError, transaction

from races.models import Duel, DuelCompetitor, Entry, Race
from tests.duels import (
    a_duel_race,
    drawn,
    driving,
    end,
)
from tests.factories import a_racer

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("commits")]


# --- what the database refuses


@pytest.mark.parametrize(
    "change",
    [
        {"state": "decided"},
        {"decided_at": "2026-01-01T00:00Z"},
        {"evaluation": None},
        {"state": "lost"},
        {"number": 0},
    ],
)
def test_the_database_refuses_a_contradictory_heat(now, change):
    race = drawn(now, 2)
    with pytest.raises(IntegrityError), transaction.atomic():
        Duel.objects.filter(pk=driving(race)[0].pk).update(**change)


@pytest.mark.parametrize(
    "change",
    [
        {"points": 1},
        {"place": 1},
        {"laps": 1},
        {"grid": 0},
        {"place": 1, "points": 9},
        {"place": 1, "points": 1, "forfeited": True},
        {"grid": 2},
    ],
)
def test_the_database_refuses_impossible_points(now, change):
    race = drawn(now, 2)
    with pytest.raises(IntegrityError), transaction.atomic():
        DuelCompetitor.objects.filter(duel=driving(race)[0], grid=1).update(**change)


@pytest.mark.parametrize("change", [{"points": 1}, {"rank_score": 5}, {"seed": 2}, {"seed": None}, {"rank_lap": 5}])
def test_the_database_refuses_a_standing_without_duels(now, change):
    race = drawn(now, 2)
    with pytest.raises(IntegrityError), transaction.atomic():
        Entry.objects.filter(race=race, seed=1).update(**change)


def test_racers_in_a_heat_and_heats_in_a_round_are_unique(now):
    race = drawn(now, 2)
    car = driving(race)[0].cars.first()
    with pytest.raises(IntegrityError), transaction.atomic():
        DuelCompetitor.objects.create(duel=car.duel, entry=car.entry, grid=3)
    with pytest.raises(IntegrityError), transaction.atomic():
        Duel.objects.create(race=race, round=1, number=1)


def test_a_bracket_with_more_than_two_cars_a_heat_is_refused(now):
    with pytest.raises(IntegrityError), transaction.atomic():
        a_duel_race(now, duel_format="bracket", duel_cars=3)
    race = Race(race_type="head_to_head", opponents="models", duel_format="bracket", duel_cars=3)
    assert set(race_problems(race)) == {"duel_cars"}


def race_problems(race: Race) -> dict:
    from races.models.layout import problems_of

    return problems_of(race)


# --- admins look


def test_draws_and_duels_are_read_only_in_the_admin(now, client):
    admin = a_racer("sam", is_staff=True, is_superuser=True)
    race = drawn(now, 2)
    (duel,) = driving(race)
    end(duel, now, winners=[2, 1])
    client.force_login(admin, backend="django.contrib.auth.backends.ModelBackend")
    for path in ("draw/", f"draw/{race.pk}/change/", "duel/", f"duel/{duel.pk}/change/", "duel/?q=car-2"):
        assert client.get(f"/admin/races/{path}").status_code == 200, path
    page = client.get(f"/admin/races/duel/{duel.pk}/change/").content.decode()
    assert "car-2" in page and 'name="_save"' not in page
    assert client.get("/admin/races/duel/add/").status_code == 403
