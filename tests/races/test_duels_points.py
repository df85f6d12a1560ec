"""What a heat is worth, who goes on, and how a season rates."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from races.duels.bracket import tie_winner
from races.duels.points import POINTS, HeatDrive, HeatsTotal, order, places, points_lap_time
from races.duels.ratings import rate


@pytest.mark.parametrize("cars", POINTS)
def test_a_car_scores_a_point_for_every_car_behind_it(cars):
    given_ = places(list(range(cars)))
    assert given_ == {car: (car + 1, cars - 1 - car) for car in range(cars)}


def test_a_retired_car_is_last_and_scores_nothing():
    assert places([7, 5, 6, 8], lost=[7, 6]) == {5: (1, 3), 8: (2, 2), 7: (3, 0), 6: (4, 0)}


def test_nobody_scores_if_everybody_retires():
    assert places([2, 1], lost=[1, 2]) == {2: (1, 0), 1: (2, 0)}


def test_a_heat_of_invalid_size_or_with_a_repeated_car_is_an_error():
    with pytest.raises(KeyError):
        places([1, 2, 3, 4, 5])
    with pytest.raises(ValueError, match="twice"):
        places([1, 1])


@given(st.permutations(range(4)), st.sets(st.integers(0, 3)))
def test_places_are_unique_and_points_never_rise_with_them(order_, lost):
    ranked = sorted(places(order_, lost).values())
    assert [place for place, _ in ranked] == [1, 2, 3, 4]
    assert [points for _, points in ranked] == sorted((points for _, points in ranked), reverse=True)


def test_the_average_lap_covers_all_complete_laps_rounded_down():
    total = points_lap_time([HeatDrive(1, 1, laps=3, time_ms=30_000), HeatDrive(2, 0, laps=1, time_ms=10_003)])
    assert (total, total.lap_ms) == (HeatsTotal(1, 4, 40_003), 10_000)
    assert points_lap_time([]).lap_ms is None


def test_the_board_ranks_by_points_average_lap_then_qualifying():
    totals = {
        1: HeatsTotal(2, 1, 11_000),
        2: HeatsTotal(5, 3, 90_000),
        3: HeatsTotal(2, 2, 20_000),
        4: HeatsTotal(2, 0, 0),
        5: HeatsTotal(2, 1, 10_000),
    }
    assert order(totals) == [2, 3, 5, 1, 4]


def leg(first: tuple[int, int, int], second: tuple[int, int, int]) -> dict[int, HeatDrive]:
    """A heat of seeds 3 and 5: (points, laps, time in ms) of each."""
    return {3: HeatDrive(1, *first), 5: HeatDrive(1, *second)}


def test_a_tie_is_decided_by_points_first():
    heats = [leg((0, 3, 1_000), (1, 3, 9_000)), leg((0, 3, 1_000), (1, 3, 9_000))]
    assert tie_winner((3, 5), heats) == 5


def test_at_one_win_each_laps_then_time_decide():
    assert tie_winner((3, 5), [leg((1, 3, 9_000), (0, 2, 5_000)), leg((0, 3, 9_000), (1, 3, 9_000))]) == 3
    assert tie_winner((3, 5), [leg((1, 3, 9_000), (0, 3, 9_500)), leg((0, 3, 9_000), (1, 3, 8_000))]) == 5


def test_if_all_is_equal_the_better_seed_advances():
    assert tie_winner((3, 5), [leg((0, 0, 0), (0, 0, 0)), leg((0, 0, 0), (0, 0, 0))]) == 3


def test_ratings_rise_with_wins_and_are_deterministic():
    duels = [{"ann": 1, "bob": 2}, {"bob": 1, "cyd": 2, "ann": 3}, {"ann": 1, "cyd": 2}]
    ratings = rate(duels)
    assert ratings == rate(duels)
    assert {name: one.duels for name, one in ratings.items()} == {"ann": 3, "bob": 2, "cyd": 2}
    winner, loser = (rate([{"ann": 1, "bob": 2}])[name] for name in ("ann", "bob"))
    assert winner.mu > 25 > loser.mu and winner.sigma == loser.sigma < 25 / 3
    assert winner.shown > loser.shown


def test_the_first_duel_is_rated_like_openskills_own_example():
    """openskill 6.2, PlackettLuce().rate([[a], [b]]) of two newcomers."""
    winner = rate([{"ann": 1, "bob": 2}])["ann"]
    assert (winner.mu, winner.sigma) == (27.635389, 8.065901)


def test_a_draw_leaves_newcomers_equal_and_one_car_unrated():
    tied = rate([{"ann": 1, "bob": 1}])
    assert tied["ann"] == tied["bob"]
    assert rate([{"ann": 1}]) == {}


def test_ratings_depend_on_the_order_of_the_duels():
    one, other = {"ann": 1, "bob": 2}, {"bob": 1, "cyd": 2}
    assert rate([one, other]) != rate([other, one])
