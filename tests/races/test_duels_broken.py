"""Duels that go wrong: heats that fail, racers who leave."""

from __future__ import annotations

import pytest

from evaluation.models import State
from evaluation.running.queue.services import stop_evaluation
from races.boards.selectors.board import board
from races.duels import services as duel_services
from races.entries.services.entries import remove_entry, restore_entry
from races.models import Draw, Duel, DuelState, Entry, Race
from tests.duels import (
    break_down,
    drawn,
    driving,
    end,
    end_all,
    points,
    ranking,
)
from tests.factories import a_racer

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("commits")]


# --- what goes wrong


def test_a_heat_the_platform_fails_is_repeated_then_void(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    runs = set()
    for _ in range(duel_services.MAX_TRIES):
        duel.refresh_from_db()
        runs.add(duel.evaluation_id)
        break_down(duel, now)
    duel.refresh_from_db()
    assert (duel.state, duel.tries, len(runs)) == (DuelState.VOID, 3, 3)
    assert set(duel.cars.values_list("points", "place")) == {(None, None)}
    assert [each.round for each in driving(race)] == [2], "the race goes on"
    assert points(race) == {1: (0, 0, None), 2: (0, 0, None)}


def test_a_repeated_heat_counts_like_any_other(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    break_down(duel, now)
    (again,) = driving(race)
    assert again == duel and again.evaluation != duel.evaluation and again.tries == 2
    end(again, now, winners=[2, 1])
    assert points(race)[2][0] == 1


def test_a_tie_with_void_heats_goes_to_the_better_seed(now):
    race = drawn(now, 2, duel_format="bracket")
    while heats := driving(race):
        for duel in heats:
            break_down(duel, now)
    assert Draw.objects.get().over_at is not None
    assert ranking(race) == ["car-1", "car-2"]


def test_a_heat_stopped_by_an_admin_is_driven_again(now):
    race = drawn(now, 2)
    (duel,) = driving(race)
    stop_evaluation(evaluation=duel.evaluation, now=now)
    (again,) = driving(race)
    assert again == duel and again.evaluation != duel.evaluation


# --- who leaves


def remove(race: Race, seed: int, now) -> Entry:
    entry = Entry.objects.get(race=race, seed=seed)
    admin = entry.racer.__class__.objects.filter(is_staff=True).first() or a_racer("sam", is_staff=True)
    return remove_entry(entry=entry, by=admin, now=now, reason="Not theirs.")


def test_a_removed_racer_forfeits_undecided_heats(now):
    race = drawn(now, 2)
    (first,) = driving(race)
    end(first, now, winners=[2, 1])
    remove(race, 2, now)
    assert not driving(race) and Draw.objects.get().over_at == now
    last = Duel.objects.get(round=2)
    assert last.is_walkover and last.evaluation is None
    assert set(last.cars.values_list("entry__seed", "points", "forfeited")) == {(1, 1, False), (2, 0, True)}
    assert [(row.alias, row.rank, row.entry.points) for row in board(race).rows] == [("car-1", 1, 1)]


def test_the_others_drive_on_without_a_removed_racers_car(now):
    race = drawn(now, 4, duel_cars=4)
    (duel,) = driving(race)
    before = duel.evaluation
    remove(race, 3, now)
    (again,) = driving(race)
    before.refresh_from_db()
    assert before.state == State.STOPPED and again == duel and again.tries == 1, "that cost no try"
    assert again.evaluation.rivals.count() == 2
    end(again, now, winners=[4, 1, 2])
    rows = duel.cars.order_by("place").values_list("entry__seed", "points")
    assert list(rows) == [(4, 3), (1, 2), (2, 1), (3, 0)]


def test_the_last_remaining_racer_wins_by_walkovers(now):
    race = drawn(now, 4, duel_format="bracket")
    for seed in (1, 2, 3):
        remove(race, seed, now)
    assert Draw.objects.get().over_at == now
    assert [row.alias for row in board(race).rows] == ["car-4"]
    assert points(race)[4][0] == 2


def test_a_restored_racer_drives_the_remaining_heats(now):
    race = drawn(now, 3)
    entry = remove(race, 1, now)
    restore_entry(entry=entry, by=a_racer("tom", is_staff=True))
    end_all(race, now)
    assert points(race)[1][0] >= 2
