"""The league's rules by themselves."""

from __future__ import annotations

from decimal import Decimal
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from league.standings.rules import ChampionshipField, FinaleField, PointsTable, Promotion, RoundRank, Standings

PERCENTS = st.decimals(min_value="0.1", max_value="99.9", places=1)


@pytest.mark.parametrize(
    "classified, places",
    [(0, 0), (1, 1), (4, 1), (14, 1), (15, 2), (24, 2), (25, 3), (1090, 109), (1273, 127), (5967, 597)],
)
def test_the_promoted_share_is_rounded_half_up(classified, places):
    assert Promotion(10).places(classified) == places


@pytest.mark.parametrize("percent", [0, 100, -1, 250, Decimal("0.0")])
def test_promoting_nobody_or_everybody_is_refused(percent):
    with pytest.raises(ValueError, match="between"):
        Promotion(percent)


@given(PERCENTS, st.integers(0, 10_000))
def test_a_share_is_at_most_half_a_racer_off(percent, classified):
    places = Promotion(percent).places(classified)
    share = classified * percent / 100
    assert places == 1 or abs(places - share) <= Decimal("0.5")
    assert places <= classified and (places > 0) == (classified > 0)


def test_an_already_promoted_racer_uses_up_a_place():
    assert Promotion(20).promoted(list("abcdefghij"), 10, already={"a"}) == [(2, "b")]
    assert Promotion(20).promoted(list("abcdefghij"), 10) == [(1, "a"), (2, "b")]


def test_a_finale_takes_the_best_who_have_not_qualified():
    assert FinaleField(3).chosen("abcdef", qualified={"b", "x"}) == ["a", "c", "d"]
    assert FinaleField(16).chosen("ab", qualified=set()) == ["a", "b"]


def test_the_first_three_of_a_finale_qualify_once():
    assert ChampionshipField(3).chosen("abcdef", qualified=set()) == ["a", "b", "c"]
    assert ChampionshipField(3).chosen("abcdef", qualified={"b"}) == ["a", "c", "d"]


@pytest.mark.parametrize("rule", [FinaleField, ChampionshipField])
def test_an_empty_field_is_refused(rule):
    with pytest.raises(ValueError, match="at least 1"):
        rule(0)


def test_a_points_table_never_rises():
    assert [PointsTable((25, 18, 18, 0)).of(rank) for rank in (1, 2, 3, 4, 5, 0)] == [25, 18, 18, 0, 0, 0]
    for wrong in ((10, 11), (), (5, -1)):
        with pytest.raises(ValueError):
            PointsTable(wrong)


def lines(results, rounds, drop=0):
    made = Standings(drop).lines([RoundRank(*one) for one in results], rounds)
    return [(line.holder, line.points) for line in made]


def test_points_add_up_and_the_worst_results_are_dropped():
    results = [("a", 1, 1, 25), ("a", 2, 2, 18), ("a", 3, 3, 15), ("b", 1, 2, 18), ("b", 2, 1, 25)]
    assert lines(results, 3) == [("a", 58), ("b", 43)]
    # a loses the 15, b the round that they missed; the same places but for a's third
    assert lines(results, 3, drop=1) == [("a", 43), ("b", 43)]
    dropped = Standings(1).lines([RoundRank(*one) for one in results], 3)
    assert {line.holder: line.dropped for line in dropped} == {"a": {3}, "b": frozenset()}


def test_at_least_one_result_always_counts():
    assert lines([("a", 1, 1, 25)], 1, drop=5) == [("a", 25)]
    assert Standings(5).counting(0) == 0 and Standings(2).counting(8) == 6


@pytest.mark.parametrize(
    "why, first, second",
    [
        ("more first places", [(1, 1, 10), (2, 5, 0)], [(1, 2, 5), (2, 2, 5)]),
        ("then more second places", [(1, 1, 10), (2, 2, 6), (3, 9, 0)], [(1, 3, 3), (2, 1, 10), (3, 3, 3)]),
        ("one more result at all", [(1, 1, 10), (2, 9, 0)], [(2, 1, 10)]),
        ("the better place in the latest round", [(1, 2, 6), (2, 1, 10)], [(1, 1, 10), (2, 2, 6)]),
    ],
)
def test_equal_points_follow_the_tie_breakers(why, first, second):
    results = [("z", *one) for one in first] + [("a", *one) for one in second]
    assert sum(one[2] for one in first) == sum(one[2] for one in second), why
    for order in (results, results[::-1]):
        assert [who for who, _points in lines(order, 3)] == ["z", "a"], why


@given(st.data())
def test_the_order_of_results_changes_nothing(data):
    rounds = data.draw(st.integers(1, 5))
    table = PointsTable((10, 6, 3, 1))
    results = []
    for number in range(1, rounds + 1):
        for rank, who in enumerate(data.draw(st.permutations("abcdef")), start=1):
            results.append((who, number, rank, table.of(rank)))
    drop = data.draw(st.integers(0, 3))
    shuffled = data.draw(st.permutations(results))
    made = Standings(drop).lines([RoundRank(*one) for one in shuffled], rounds)
    assert made == Standings(drop).lines([RoundRank(*one) for one in results], rounds)
    assert [line.place for line in made] == list(range(1, len(made) + 1))
    assert all(before.points >= after.points for before, after in pairwise(made))
    assert all(len(line.results) - len(line.dropped) == Standings(drop).counting(rounds) for line in made)


def test_every_rule_states_its_numbers():
    assert "10 %" in Promotion(Decimal("10.0")).sentence() and "12.5 %" in Promotion("12.5").sentence()
    assert "best 16" in FinaleField(16).sentence() and "best 3 of a finale" in ChampionshipField(3).sentence()
    assert "25, 18, 15" in PointsTable((25, 18, 15)).sentence()
    assert "worst 2 results" in Standings(2).sentence() and "All rounds count" in Standings().sentence()
