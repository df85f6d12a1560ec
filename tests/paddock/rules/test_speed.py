"""Commands of speed: what each mode makes of a model's speed, and what is no command."""

from __future__ import annotations

import json

import pytest

from paddock.rules.race import RaceRules
from paddock.rules.speed import MOST_COMMANDS, SpeedCommand


@pytest.mark.parametrize(
    ("mode", "value", "wanted", "driven"),
    [
        ("model_speed", 0, 1.2345, 1.2345),
        ("multiplier", 1.5, 1.2, 1.8),
        ("multiplier", 0.5, 1.2, 0.6),
        ("multiplier", 1.5, 3.9, 4.0),
        ("cap", 1.0, 2.5, 1.0),
        ("cap", 1.0, 0.7, 0.7),
        ("absolute", 2.25, 0.7, 2.25),
        ("percent_max", 50, 0.7, 2.0),
        ("offset", -0.4, 1.0, 0.6),
        ("offset", -3.0, 1.0, 0.1),
        ("offset", 3.9, 1.0, 4.0),
    ],
)
def test_a_mode_makes_of_the_speed_what_it_says_within_what_the_car_can(mode, value, wanted, driven):
    assert SpeedCommand(0, mode, value).speed_of(wanted) == driven


@pytest.mark.parametrize(
    "command",
    [
        {"at_ms": -1, "mode": "cap", "value": 1.0},
        {"at_ms": 1.5, "mode": "cap", "value": 1.0},
        {"at_ms": 0, "mode": "faster", "value": 1.0},
        {"at_ms": 0, "mode": "multiplier", "value": 1.51},
        {"at_ms": 0, "mode": "multiplier", "value": float("nan")},
        {"at_ms": 0, "mode": "cap", "value": True},
        {"at_ms": 0, "mode": "percent_max", "value": 101},
        {"at_ms": 0, "mode": "model_speed", "value": 1},
        {"at_ms": 0, "mode": "cap", "value": 1.0, "car": -1},
    ],
)
def test_what_is_no_command_is_refused(command):
    with pytest.raises(ValueError, match="must be"):
        SpeedCommand(**command)


def test_a_log_is_in_the_order_of_its_times_and_ends():
    early, late = SpeedCommand(100, "cap", 1.0), SpeedCommand(200, "cap", 2.0)
    RaceRules(speed_commands=(early, late, SpeedCommand(100, "cap", 1.0, car=1)))
    for wrong in ((late, early), (early, early)):
        with pytest.raises(ValueError, match="order of their times"):
            RaceRules(speed_commands=wrong)
    with pytest.raises(ValueError, match="at most"):
        RaceRules(speed_commands=tuple(SpeedCommand(at, "cap", 1.0) for at in range(MOST_COMMANDS + 1)))


def test_a_log_stands_in_the_rules_that_are_kept_and_only_where_there_is_one():
    rules = RaceRules(speed_commands=(SpeedCommand(0, "cap", 1.0), SpeedCommand(500, "model_speed", 0, car=0)))
    assert RaceRules.from_dict(json.loads(json.dumps(rules.to_dict()))) == rules
    assert "speed_commands" not in RaceRules().to_dict()
