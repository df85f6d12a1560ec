import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paddock.errors import UserFault
from paddock.simulator.action import ActionSpace
from tests.shared import SHARED, needs_shared

CONTINUOUS = {
    "action_space_type": "continuous",
    "action_space": {"steering_angle": {"low": -20, "high": 30}, "speed": {"low": "0.5", "high": 2}},
}


def test_the_highest_score_wins_and_the_first_of_equals():
    space = ActionSpace.discrete([(-30, 1), (0, 2), (30, 1)])
    assert space.decode(np.float32([0.1, 0.7, 0.2])) == (0.0, 2.0, 1)
    assert space.decode(np.float32([0.4, 0.2, 0.4])).index == 0
    assert space.decode(np.float32([[0.1, 0.2, 0.9]])).index == 2  # any shape of that size


def test_two_values_are_scaled_to_the_ranges():
    space = ActionSpace.from_metadata(CONTINUOUS)
    assert space.decode(np.float32([-1, -1])) == (-20.0, 0.5, None)
    assert space.decode(np.float32([1, 1])) == (30.0, 2.0, None)
    assert space.decode(np.float32([0, 0])) == (5.0, 1.25, None)
    assert space.decode(np.float32([9, -9])) == (30.0, 0.5, None)


def test_actions_are_clipped_to_the_car_and_rounded():
    space = ActionSpace.discrete([(45, 9), (-45, 0.01), (1.23456789, 1.00004999)])
    assert [space.decode(np.eye(3)[i])[:2] for i in range(3)] == [(30.0, 4.0), (-30.0, 0.1), (1.2346, 1.0)]


@needs_shared
def test_numbers_in_metadata_may_be_strings():
    metadata = json.loads((SHARED / "traces" / "a-to-z-2023-model_metadata.json").read_text())
    for action in metadata["action_space"]:
        action["speed"] = str(action["speed"])
    space = ActionSpace.from_metadata(metadata)
    assert space.size == 10
    assert space.actions[4] == (15.0, 2.5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_non_finite_answer_is_the_racers_fault(bad):
    for space in (ActionSpace.discrete([(0, 1), (5, 1)]), ActionSpace.from_metadata(CONTINUOUS)):
        with pytest.raises(UserFault) as caught:
            space.decode(np.float32([0.5, bad]), step=17)
        assert caught.value.code == "non_finite_action"
        assert "17" in str(caught.value)


def test_an_answer_of_another_size_is_refused():
    with pytest.raises(ValueError, match="2 values"):
        ActionSpace.discrete([(0, 1)]).decode(np.float32([1, 2]))


@pytest.mark.parametrize("actions", [[], [(float("nan"), 1.0)]])
def test_an_empty_or_invalid_action_list_is_refused(actions):
    with pytest.raises(ValueError):
        ActionSpace.discrete(actions)


def test_an_inverted_range_is_refused():
    with pytest.raises(ValueError, match="low < high"):
        ActionSpace.continuous((10, -10), (1, 2))


@given(st.lists(st.floats(-1e6, 1e6, width=32), min_size=2, max_size=2))
def test_every_command_stays_within_the_cars_limits(values):
    steering, speed, index = ActionSpace.from_metadata(CONTINUOUS).decode(np.float32(values))
    assert -20 <= steering <= 30
    assert 0.5 <= speed <= 2
    assert index is None
    assert round(steering, 4) == steering and round(speed, 4) == speed


def test_a_chosen_place_of_a_list_is_its_command():
    space = ActionSpace.discrete([(-20.0, 1.0), (0.0, 2.0), (20.0, 1.5)])
    for place in range(3):
        scores = [1.0, 1.0, 1.0]
        scores[place] = 2.0
        assert space.decode(place) == space.decode(scores)
    for wrong in (-1, 3):
        with pytest.raises(ValueError):
            space.decode(wrong)
    with pytest.raises(ValueError):
        ActionSpace.continuous((-30.0, 30.0), (1.0, 2.0)).decode(1)
