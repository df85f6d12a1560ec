"""Errors about ranges name a field by its label, in the reader's language, never by its internal name."""

from __future__ import annotations

import re

import pytest
from django.utils import translation

from core.forms import explain
from paddock.errors import UserFault
from paddock.rules.hyperparameters import HYPERPARAMETERS
from paddock.rules.training import RANDOMISED, TrainingSettings
from training.jobs.settings_checks import check_action_space, check_hyperparameters, check_settings

RANGES = {"steering_angle": {"low": -30, "high": 30}, "speed": {"low": 0.5, "high": 2}}


def refusal(call, *given) -> UserFault:
    with pytest.raises(UserFault) as refused:
        call(*given)
    return refused.value


@pytest.mark.parametrize(
    ("name", "end", "value", "words"),
    [
        ("steering_angle", "low", -31, "Enter a steering angle from −30 to 30."),
        ("steering_angle", "high", None, "Enter a steering angle from −30 to 30."),
        ("speed", "low", 0.05, "Enter a speed from 0.1 to 4."),
        ("speed", "high", 5, "Enter a speed from 0.1 to 4."),
    ],
)
def test_a_wrong_range_names_its_label(name, end, value, words):
    given = {**RANGES, name: {**RANGES[name], end: value}}
    fault = refusal(check_action_space, "ppo", "continuous", given)
    assert explain(fault) == words and fault.code == "training_range_value"
    with translation.override("ko"):
        assert not re.search("[a-z]", explain(fault))


def test_a_wrong_row_of_the_table_names_its_number_and_label():
    rows = [{"steering_angle": 0, "speed": 1}, {"steering_angle": 40, "speed": 1}]
    fault = refusal(check_action_space, "ppo", "discrete", rows)
    assert explain(fault) == "Action 1: enter a steering angle from −30 to 30."
    with translation.override("ko"):
        assert not re.search("[a-z]", explain(fault))


def test_crossed_ends_name_their_label():
    fault = refusal(check_action_space, "ppo", "continuous", {**RANGES, "steering_angle": {"low": 10, "high": -10}})
    assert explain(fault) == "The lowest steering angle must be less than the highest."


@pytest.mark.parametrize("name", [name for name, one in HYPERPARAMETERS.items() if not one.choices])
def test_a_wrong_hyperparameter_is_named_by_its_label(name):
    algorithm = "sac" if name == "sac_alpha" else "ppo"
    fault = refusal(check_hyperparameters, algorithm, {name: -1e9})
    assert str(HYPERPARAMETERS[name].label) in explain(fault) and name not in explain(fault)
    with translation.override("ko"):
        assert str(HYPERPARAMETERS[name].label) not in explain(fault)


@pytest.mark.parametrize("name", RANDOMISED)
def test_a_wrong_strength_is_named_by_its_label(name):
    settings = TrainingSettings(action_space_type="continuous", action_space=RANGES, **{name: 101})
    assert name not in explain(refusal(check_settings, settings))
