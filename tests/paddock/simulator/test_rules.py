import json

import pytest

from paddock.rules.race import RaceRules, penalty_steps
from paddock.simulator.physics import milliseconds


def test_rules_survive_json():
    rules = RaceRules(laps=5, max_resets=0, direction="cw", seed=7)
    assert RaceRules.from_dict(json.loads(json.dumps(rules.to_dict()))) == rules


@pytest.mark.parametrize(
    "bad",
    [
        {"laps": 0},
        {"laps": True},
        {"laps": 1.5},
        {"max_resets": -1},
        {"max_simulated_ms": 0},
        {"off_track_penalty_ms": -1},
        {"direction": "left"},
        {"race_type": "rally"},
        {"seed": -1},
    ],
)
def test_invalid_rules_are_refused(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        RaceRules(**bad)


def test_an_unknown_rule_is_refused():
    with pytest.raises(TypeError):
        RaceRules.from_dict({"lap_count": 3})


def test_penalties_are_rounded_up_to_whole_steps():
    assert [penalty_steps(ms, 15.0) for ms in (0, 1, 200, 2000, 5000, 2500)] == [0, 1, 3, 30, 75, 38]


def test_the_clock_counts_steps_and_fractions_of_them():
    assert milliseconds(0) == 0
    assert milliseconds(15) == 1000
    assert milliseconds(1) == 67
    assert milliseconds(0.5) == 33
    assert milliseconds(2700) == 180_000
