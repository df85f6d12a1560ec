"""An answer is clear when no error within the bound makes another command of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paddock.simulator.action import ActionSpace, is_clear

WIDE = ActionSpace.continuous((-30.0, 30.0), (0.5, 4.0))
NARROW = ActionSpace.continuous((-12.34, 7.0), (1.0, 1.0005))
BEYOND = ActionSpace.continuous((-50.0, 50.0), (0.01, 9.0))  # clipped to what the car can do
TABLE = ActionSpace.discrete([(-20.0, 1.0), (0.0, 2.0), (20.0, 1.0)])
values = st.floats(-1.25, 1.25, width=32)
bounds = st.floats(1e-8, 1e-3)
errors = st.floats(-1.0, 1.0)


@pytest.mark.parametrize("space", [WIDE, NARROW, BEYOND])
@given(pair=st.tuples(values, values), bound=bounds, wrong=st.tuples(errors, errors))
def test_a_clear_continuous_answer_gives_one_command(space, pair, bound, wrong):
    if is_clear(pair, bound, space.ranges):
        other = [value + bound * error for value, error in zip(pair, wrong, strict=True)]
        assert space.decode(np.array(other)) == space.decode(np.array(pair))


@given(scores=st.lists(values, min_size=3, max_size=3), bound=bounds, wrong=st.lists(errors, min_size=3, max_size=3))
def test_a_clear_discrete_answer_gives_one_action(scores, bound, wrong):
    if is_clear(scores, bound, TABLE.ranges):
        other = [value + bound * error for value, error in zip(scores, wrong, strict=True)]
        assert TABLE.decode(np.array(other)) == TABLE.decode(np.array(scores))


@pytest.mark.parametrize("space", [WIDE, BEYOND])
@given(
    step=st.integers(0, 3000),
    off=st.floats(-0.6, 0.6),
    bound=st.floats(1e-8, 1e-5),
    wrong=st.tuples(errors, errors),
)
def test_a_clear_answer_near_a_rounding_gives_one_command(space, step, off, bound, wrong):
    """Where answers are close to a rounding, of which one at random never is."""
    pair = [
        (value - low) / (high - low) * 2.0 - 1.0
        for value, (low, high) in zip(
            (-15.0 + (step + 0.5 + off / 5) * 0.01, 0.6 + (step + 0.5 + off / 5) * 0.001), space.ranges, strict=True
        )
    ]
    if is_clear(pair, bound, space.ranges):
        other = [value + bound * error for value, error in zip(pair, wrong, strict=True)]
        assert space.decode(np.array(other)) == space.decode(np.array(pair))


def test_an_answer_half_way_between_two_steps_is_not_clear():
    value = 0.005 / 30.0  # 0.005 degrees: 0.00 or 0.01
    assert not is_clear([value, 0.0], 1e-7, WIDE.ranges)
    assert is_clear([value + 2e-5, 0.0], 1e-7, WIDE.ranges)


def test_most_answers_are_clear_at_realistic_errors():
    pairs = np.random.default_rng(3).uniform(-1.0, 1.0, (5000, 2)).tolist()
    assert np.mean([is_clear(pair, 2e-6, WIDE.ranges) for pair in pairs]) > 0.97


def test_an_answer_clipped_to_an_end_is_clear():
    assert is_clear([1.5, -7.0], 1e-3, WIDE.ranges)


def test_the_best_of_two_equal_scores_is_not_clear():
    assert not is_clear([1.0, 1.0, 0.0], 0.0, None)
    assert is_clear([1.0, 0.9, 0.9], 0.04, None)
    assert not is_clear([1.0, 0.9, 0.9], 0.06, None)


def test_the_only_action_is_always_clear():
    assert is_clear([0.3], 1.0, None)


@pytest.mark.parametrize("ranges", [None, WIDE.ranges])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_non_finite_answer_is_never_clear(ranges, value):
    assert not is_clear([value, 0.1], 1e-6, ranges)
