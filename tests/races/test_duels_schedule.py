"""Who meets whom: round robins and brackets of every size."""

from __future__ import annotations

import random
from collections import Counter
from itertools import combinations, permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from races.duels.bracket import (
    Tie,
    bracket,
    deciders,
    heat_number,
    round_count,
    seeding,
    tie_of,
    ties_won,
    winners_of,
)
from races.duels.points import HeatDrive
from races.duels.schedule import round_robin
from tests.soak import examples

fields = st.integers(2, 20)
groups = st.integers(3, 4)


def heats_of(rounds) -> list[tuple[int, ...]]:
    return [heat for heats in rounds for heat in heats]


def in_front(heats) -> Counter:
    """How often the first of two cars started in front of the second."""
    return Counter(pair for heat in heats for pair in combinations(heat, 2))


@given(fields)
def test_in_pairs_everybody_meets_everybody_from_both_orders(entrants):
    heats = heats_of(round_robin(entrants))
    assert sorted(heats) == sorted(permutations(range(1, entrants + 1), 2))


@given(fields)
def test_in_pairs_the_second_half_repeats_the_first_swapped(entrants):
    rounds = round_robin(entrants)
    half = len(rounds) // 2
    assert len(rounds) == 2 * (entrants - 1 + entrants % 2)
    assert rounds[half:] == [[heat[::-1] for heat in heats] for heats in rounds[:half]]


@settings(deadline=None, max_examples=examples(40))
@given(fields, groups)
def test_in_groups_both_orders_of_a_pair_are_equally_frequent(entrants, cars):
    front = in_front(heats_of(round_robin(entrants, cars)))
    assert set(front) == set(permutations(range(1, entrants + 1), 2))
    assert all(front[one, other] == front[other, one] for one, other in front)


@settings(deadline=None, max_examples=examples(40))
@given(fields, groups)
def test_in_groups_each_car_starts_equally_often_from_each_slot(entrants, cars):
    heats = heats_of(round_robin(entrants, cars))
    started = Counter((car, place) for heat in heats for place, car in enumerate(heat))
    assert len({*started.values()}) == 1
    assert len(started) == entrants * min(entrants, cars)


@settings(deadline=None)
@given(fields, st.integers(2, 4))
def test_no_car_meets_itself_nor_drives_twice_in_a_round(entrants, cars):
    for heats in round_robin(entrants, cars):
        driving = [car for heat in heats for car in heat]
        assert len(set(driving)) == len(driving)


@settings(deadline=None)
@given(fields, st.integers(2, 4))
def test_a_heat_has_the_wanted_number_of_cars_or_all_of_them(entrants, cars):
    assert {len(heat) for heat in heats_of(round_robin(entrants, cars))} == {min(entrants, cars)}


def test_the_schedule_of_four_cars_is_fixed():
    first = [[(1, 4), (3, 2)], [(3, 1), (2, 4)], [(1, 2), (4, 3)]]
    assert round_robin(4) == first + [[heat[::-1] for heat in heats] for heats in first]


def test_sixteen_cars_need_240_pairs_or_64_heats_of_four():
    assert len(heats_of(round_robin(16, 2))) == 240
    assert len(heats_of(round_robin(16, 4))) == 64


@pytest.mark.parametrize("entrants", [0, 1])
def test_a_single_car_has_no_heats(entrants):
    assert round_robin(entrants) == [] and bracket(entrants, {}) == []


@pytest.mark.parametrize("cars", [0, 1, 5])
def test_an_invalid_number_of_cars_a_heat_is_refused(cars):
    with pytest.raises(ValueError, match="cars"):
        round_robin(8, cars)


@pytest.mark.parametrize(
    ("entrants", "order"),
    [(2, [1, 2]), (4, [1, 4, 2, 3]), (8, [1, 8, 4, 5, 2, 7, 3, 6]), (5, [1, 8, 4, 5, 2, 7, 3, 6])],
)
def test_the_best_seeds_are_placed_far_apart(entrants, order):
    assert seeding(entrants) == order


@given(st.integers(2, 64))
def test_byes_go_to_the_best_seeds(entrants):
    first = bracket(entrants, {})[0]
    byes = 2 ** round_count(entrants) - entrants
    assert sorted(tie.winner for tie in first if tie.bye) == list(range(1, byes + 1))
    assert sorted(car for tie in first for car in tie.cars) == list(range(1, entrants + 1))


@given(st.integers(2, 64))
def test_if_better_seeds_always_win_the_best_two_meet_last(entrants):
    rounds = play(entrants, min)
    assert rounds[-1][0].cars == (1, 2) and rounds[-1][0].winner == 1
    for number, ties in enumerate(reversed(rounds)):
        expected = set(range(1, min(entrants, 2 ** (number + 1)) + 1))
        assert {car for tie in ties for car in tie.cars} == expected


@given(st.integers(2, 64), st.randoms(use_true_random=False))
def test_a_bracket_has_one_champion_and_all_others_lose_once(entrants, chance):
    rounds = play(entrants, lambda cars: chance.choice(cars))
    lost = [car for ties in rounds for tie in ties for car in tie.cars if car != tie.winner]
    champion = rounds[-1][0].winner
    assert sorted([*lost, champion]) == list(range(1, entrants + 1))
    won = ties_won(rounds)
    assert won[champion] == round_count(entrants)
    assert all(won[car] < won[champion] for car in lost)


@given(st.integers(2, 64), st.randoms(use_true_random=False))
def test_each_pair_of_a_bracket_meets_from_both_orders(entrants, chance):
    for ties in play(entrants, lambda cars: chance.choice(cars)):
        for tie in ties:
            assert tie.heats() == (() if tie.bye else (tie.cars, tie.cars[::-1]))
            assert len(set(tie.cars)) == len(tie.cars)


def play(entrants: int, choose) -> list[list[Tie]]:
    """A whole bracket in which ``choose`` says who wins."""
    winners: dict[tuple[int, int], int] = {}
    for number in range(round_count(entrants)):
        for tie in bracket(entrants, winners)[number]:
            if not tie.bye:
                winners[tie.round, tie.number] = choose(tie.cars)
    return bracket(entrants, winners)


def test_a_tie_waits_for_both_of_its_cars():
    semi, final = bracket(4, {(1, 1): 4})
    assert [tie.winner for tie in semi] == [4, None]
    assert (final[0].cars, final[0].heats(), final[0].bye) == ((4,), (), False)


@pytest.mark.parametrize("winners", [{(1, 1): 2}, {(2, 1): 1}])
def test_a_car_outside_a_tie_cannot_win_it(winners):
    with pytest.raises(ValueError, match="cannot win"):
        bracket(4, winners)


@given(st.integers(1, 32), st.integers(0, 1), st.integers(2, 3))
def test_heats_are_numbered_across_the_ties_of_a_round(tie, leg, legs):
    assert tie_of(heat_number(tie, leg, legs), legs) == tie
    assert tie_of(heat_number(tie, legs - 1, legs), legs) == tie
    assert heat_number(1, 0, legs) == 1


def heats_won_by(*winners: int | None) -> dict[tuple[int, int], dict[int, HeatDrive]]:
    """The first heats of the tie of seeds 1 and 2; None: a void one. Seed 2 is the quicker whenever it wins."""
    return {
        (1, number): {
            seed: HeatDrive(0, 0)
            if winner is None
            else HeatDrive(1 + (seed != winner), int(seed == winner), 1, 9_000 if seed == winner == 2 else 10_000)
            for seed in (1, 2)
        }
        for number, winner in enumerate(winners, 1)
    }


@pytest.mark.parametrize(
    ("winners", "winner", "third"),
    [
        ((1,), None, None),
        ((1, 1), 1, None),
        ((2, 2), 2, None),
        ((1, 2), None, (2, 1)),  # who did better in the two in front
        ((1, None), None, (1, 2)),
        ((1, 2, 1), 1, None),
        ((1, None, 2), 2, None),
        ((None, None, None), 1, None),
    ],
)
def test_of_the_best_of_three_a_third_is_driven_where_it_decides(winners, winner, third):
    heats = heats_won_by(*winners)
    assert winners_of(heats, 3) == ({} if winner is None else {(1, 1): winner})
    assert deciders(heats, 3) == ({} if third is None else {(1, 3): third})
    assert deciders(heats, 2) == {}


def test_a_tie_of_one_heat_is_decided_by_it():
    (tie,) = bracket(2, {})[0]
    assert tie.heats(1) == ((1, 2),)
    assert winners_of(heats_won_by(2), 1) == {(1, 1): 2}


def test_a_bracket_depends_only_on_its_results():
    picks = random.Random(3)
    played = play(13, lambda cars: picks.choice(cars))
    winners = {(tie.round, tie.number): tie.winner for ties in played for tie in ties if not tie.bye}
    assert bracket(13, winners) == played
