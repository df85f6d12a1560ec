"""Ranking methods: what laps are worth. No database."""

from __future__ import annotations

import random
from types import SimpleNamespace

import pytest
from django.utils import translation
from hypothesis import given
from hypothesis import strategies as st

from races.boards.ranking import RULES, best_of_sectors, drawn_rank, order_rule, rule_for
from races.models import Race
from races.ranks import LAST, NO_RESULT, NOT_CLASSIFIED
from tests.factories import lap, laps

AVERAGE, BEST, TOTAL = RULES["average"], RULES["best"], RULES["total"]

some_laps = st.lists(
    st.builds(
        lambda time, complete, percentage, resets: lap(
            0, time, complete=complete, percentage=percentage, resets=resets, off_tracks=resets
        ),
        time=st.integers(1_000, 200_000),
        complete=st.booleans(),
        percentage=st.integers(0, 99),
        resets=st.integers(0, 5),
    ),
    max_size=12,
).map(lambda driven: [one | {"number": number} for number, one in enumerate(driven, 1)])


def test_the_average_uses_the_fastest_consecutive_laps():
    standing = AVERAGE.standing(laps(12_000, 10_000, 10_100, 10_300, 11_000), 3)
    assert standing.average_ms == standing.score_ms == (10_000 + 10_100 + 10_300) // 3
    assert standing.window == (2, 4)
    assert standing.classified


def test_the_average_is_rounded_down_to_whole_milliseconds():
    assert AVERAGE.standing(laps(10_000, 10_000, 10_002), 3).score_ms == 10_000
    assert AVERAGE.standing(laps(10_001, 10_000, 10_002), 3).score_ms == 10_001


def test_a_window_does_not_span_an_unfinished_lap():
    driven = [lap(1, 9_000), lap(2, 9_000, complete=False, percentage=40), lap(3, 9_000), lap(4, 9_100)]
    assert not AVERAGE.standing(driven, 3).classified
    assert AVERAGE.standing(driven, 2).score_ms == 9_050


def test_of_equally_fast_windows_the_earliest_counts():
    assert AVERAGE.standing(laps(10_000, 10_000, 10_000), 2).window == (1, 2)


def test_an_unfinished_lap_is_never_the_best_lap():
    driven = [lap(1, 10_000), lap(2, 3_000, complete=False, percentage=30)]
    for rule in RULES.values():
        assert rule.standing(driven, 1).best_lap_ms == 10_000


def test_the_best_lap_counts_only_with_enough_consecutive_laps():
    driven = [lap(1, 10_000), lap(2, 9_000), lap(3, 2_000, complete=False)]
    assert BEST.standing(driven, 2).score_ms == 9_000
    short = BEST.standing(driven, 3)
    assert (short.classified, short.score_ms, short.best_lap_ms) == (False, None, 9_000)


def test_the_total_is_the_sum_of_all_laps():
    assert TOTAL.standing(laps(10_000, 11_000, 12_000), 3).score_ms == 33_000


def test_a_missing_lap_leaves_no_total():
    driven = [*laps(10_000, 11_000), lap(3, 5_000, complete=False, percentage=50)]
    standing = TOTAL.standing(driven, 3)
    assert (standing.classified, standing.total_ms) == (False, None)
    assert standing.driven_percent == 250


def test_a_car_without_laps_has_no_standing():
    for rule in RULES.values():
        standing = rule.standing([], 1)
        assert (standing.classified, standing.best_lap_ms, standing.sectors) == (False, None, ())
        assert standing.rank_score == NOT_CLASSIFIED
        assert standing.rank_lap == LAST


def test_requiring_zero_laps_is_refused():
    with pytest.raises(ValueError, match="at least 1"):
        AVERAGE.standing(laps(10_000), 0)


def test_sectors_come_from_the_best_lap_and_all_complete_laps():
    driven = [
        lap(1, 9_000, sectors=(3_000, 3_000, 3_000)),
        lap(2, 9_100, sectors=(2_900, 3_200, 3_000)),
        lap(3, 1_000, complete=False, sectors=(1_000,)),
    ]
    standing = BEST.standing(driven, 1)
    assert standing.sectors == (3_000, 3_000, 3_000)
    assert standing.best_sectors == (2_900, 3_000, 3_000)
    assert standing.best_lap_number == 1


def test_laps_without_sector_times_do_not_set_best_sectors():
    assert best_of_sectors([(), (3, 2, 1), ()]) == (3, 2, 1)
    assert best_of_sectors([(), ()]) == ()


def test_faults_are_counted_over_the_whole_run():
    driven = [lap(1, 9_000, off_tracks=2, resets=2), lap(2, 8_000, crashes=1, resets=1)]
    standing = BEST.standing(driven, 1)
    assert (standing.off_tracks, standing.crashes, standing.resets) == (2, 1, 3)


def test_unclassified_cars_rank_by_distance():
    far = AVERAGE.standing([lap(1, 50_000), lap(2, 1_000, complete=False, percentage=10)], 3)
    near = AVERAGE.standing([lap(1, 9_000, complete=False, percentage=99)], 3)
    assert far.key < near.key < (NO_RESULT, LAST, 0)


@given(some_laps, st.integers(1, 5), st.sampled_from(sorted(RULES)))
def test_classified_cars_rank_before_all_others(driven, minimum, method):
    standing = RULES[method].standing(driven, minimum)
    assert standing.classified == (standing.score_ms is not None)
    if standing.classified:
        assert standing.rank_score == standing.score_ms < NOT_CLASSIFIED - 10_000
        assert standing.complete_laps >= minimum
    else:
        assert NOT_CLASSIFIED - 10_000 < standing.rank_score < NO_RESULT


@given(some_laps, st.integers(1, 5))
def test_the_average_is_the_lowest_mean_of_all_windows(driven, minimum):
    """Against the plain definition."""
    windows = [driven[start : start + minimum] for start in range(len(driven) - minimum + 1)]
    means = [sum(one["time_ms"] for one in w) // minimum for w in windows if all(one["complete"] for one in w)]
    assert AVERAGE.standing(driven, minimum).score_ms == min(means, default=None)


@given(some_laps, st.integers(1, 4), st.sampled_from(sorted(RULES)), st.data())
def test_a_faster_lap_never_lowers_a_rank(driven, minimum, method, data):
    before = RULES[method].standing(driven, minimum)
    complete = [index for index, one in enumerate(driven) if one["complete"]]
    if not complete:
        return
    index = data.draw(st.sampled_from(complete))
    faster = [dict(one) for one in driven]
    faster[index]["time_ms"] = data.draw(st.integers(1, faster[index]["time_ms"]))
    assert RULES[method].standing(faster, minimum).key <= before.key


@given(some_laps, st.integers(1, 4), st.sampled_from(["average", "best"]))
def test_finishing_another_lap_never_lowers_a_rank(driven, minimum, method):
    before = RULES[method].standing(driven, minimum)
    after = RULES[method].standing([*driven, lap(len(driven) + 1, 150_000)], minimum)
    assert (after.rank_score, after.rank_lap) <= (before.rank_score, before.rank_lap)


@given(st.lists(some_laps, min_size=1, max_size=6), st.integers(1, 3), st.randoms())
def test_the_best_submission_does_not_depend_on_the_order(submissions, minimum, rng: random.Random):
    keys = [AVERAGE.standing(driven, minimum).key for driven in submissions]
    shuffled = list(submissions)
    rng.shuffle(shuffled)
    assert min(AVERAGE.standing(driven, minimum).key for driven in shuffled) == min(keys)


@pytest.mark.parametrize("method", sorted(RULES))
@pytest.mark.parametrize("count", [1, 3])
def test_every_ranking_method_explains_its_rule_with_numbers(method, count):
    race = SimpleNamespace(minimum_laps=count, laps=count, opponents="")
    with translation.override("en"):
        sentence = RULES[method].rule(race)
        assert sentence.startswith("Ranked by the ")
        assert sentence.endswith(".")
        assert "%" not in sentence
        assert ("3" in sentence) == (count == 3)
        assert "not classified" in sentence
        assert "fewer resets" in order_rule(race)


@pytest.mark.parametrize("method", RULES)
@pytest.mark.parametrize(("format_", "words"), [("round_robin", "One point per car"), ("bracket", "knock-out bracket")])
def test_a_race_of_duels_explains_qualifying_and_ranking(method, format_, words):
    options = {"ranking_method": method, "laps": 3, "minimum_laps": 3}
    race = Race(opponents="models", duel_format=format_, duel_cars=3, **options)
    sentence = rule_for(race).rule(race)
    assert sentence.startswith(f"Qualifying: {RULES[method].rule(race)}") and words in sentence
    assert "better qualifier" in order_rule(race) and "fewer resets" in order_rule(race)
    assert rule_for(Race(**options)) is RULES[method]


@given(
    st.integers(0, 1000),
    st.integers(1, 127),
    st.none() | st.integers(1, 1_200_000),
    st.integers(0, 1000),
    st.integers(1, 127),
    st.none() | st.integers(1, 1_200_000),
)
def test_drawn_cars_rank_by_points_then_average_lap_then_seed(points, seed, lap_ms, others, other_seed, other_ms):
    one, other = (points, lap_ms, seed), (others, other_ms, other_seed)

    def key(points: int, lap_ms: int | None, seed: int) -> tuple:
        return -points, lap_ms is None, lap_ms or 0, seed

    assert (drawn_rank(*one) < drawn_rank(*other)) == (key(*one) < key(*other))
    assert drawn_rank(*one)[0] < 0 and drawn_rank(*one)[1] < LAST
