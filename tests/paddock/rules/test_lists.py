"""The lists themselves: what an entry refuses, and what is read out of them."""

from __future__ import annotations

import ast
import dataclasses
import re
from argparse import ArgumentParser
from pathlib import Path

import pytest

import paddock
from paddock.rules.hyperparameters import DEFAULTS, HYPERPARAMETERS
from paddock.rules.race import RULES, RUN_RULES, RaceRules
from paddock.rules.rule import Rule
from paddock.rules.training import DRIVEN_BY, SETTINGS, TrainingSettings, taken_from
from races.management.race_options import add_race_options, rules_of
from tests.docs.test_architecture import ROOMS
from training.models import TrainingJob

SHARE = Rule("share", float, 1.0, least=0.5, most=1.0)
COUNT = Rule("count", int, 3, least=1, most=9)
OPTIONAL = Rule("count", int, None, least=1, most=9)


@pytest.mark.parametrize(("rule", "value"), [(SHARE, 0.5), (SHARE, 1), (COUNT, 9), (OPTIONAL, None)])
def test_a_value_at_a_bound_is_accepted(rule, value):
    rule.check(value)


@pytest.mark.parametrize(
    ("rule", "value"),
    [
        (SHARE, 0.49),
        (SHARE, 1.01),
        (SHARE, float("nan")),
        (SHARE, True),
        (COUNT, 0),
        (COUNT, 10),
        (COUNT, 2.0),
        (COUNT, None),
        (OPTIONAL, 0),
        (Rule("flag", bool, False), 1),
        (Rule("word", str, "a", choices=("a", "b")), "c"),
    ],
)
def test_an_invalid_value_is_refused_naming_the_rule(rule, value):
    with pytest.raises(ValueError, match=rule.name):
        rule.check(value)


def test_a_run_may_exceed_the_bounds_of_a_race():
    assert RaceRules(laps=1000, max_simulated_ms=1).laps > (RULES["laps"].most or 0)


def test_an_episode_is_one_lap_without_resets():
    rules = RaceRules.of_an_episode(direction="cw")
    assert (rules.laps, rules.max_resets, rules.direction) == (1, 0, "cw")


@pytest.mark.parametrize("name", [name for name in RULES if name in RUN_RULES and RULES[name].type is float])
def test_a_command_option_accepts_a_fraction(name):
    parser = ArgumentParser()
    add_race_options(parser)
    option = f"--{RULES[name].option or name}"
    boxes = ["--race-type", "object_avoidance", "--obstacles", "1"]
    bots = ["--race-type", "head_to_head", "--bots", "1"]
    type_ = {"object_avoidance": boxes, "head_to_head": bots}.get("".join(RULES[name].race_types[:1]), [])
    assert getattr(rules_of(vars(parser.parse_args([*type_, option, "0.75"]))), name) == 0.75


@pytest.mark.parametrize(
    "one", [*RULES.values(), *SETTINGS.values(), *HYPERPARAMETERS.values()], ids=lambda one: one.name
)
def test_every_entry_has_a_label_and_sound_bounds(one):
    assert one.label
    assert (one.least is None) == (one.most is None)
    assert one.least is None or one.least <= one.most


@pytest.mark.parametrize("algorithm", DEFAULTS)
def test_default_hyperparameters_are_within_bounds(algorithm):
    assert all(HYPERPARAMETERS[name].fits(value) for name, value in DEFAULTS[algorithm].items())


def test_settings_are_separated_from_the_rest():
    settings, rest = taken_from({"action_space_type": "discrete", "action_space": [], "trials": 5, "name": "car"})
    assert settings == TrainingSettings(action_space_type="discrete", action_space=[], trials=5)
    assert rest == {"name": "car"}


def test_a_training_requires_an_action_space():
    with pytest.raises(TypeError, match="action_space"):
        taken_from({"trials": 5})


def test_every_rule_of_a_run_is_read_where_the_run_is_simulated():
    read = set()
    for path in sorted((Path(paddock.__file__).parent / "simulator").rglob("*.py")):
        read |= {node.attr for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Attribute)}
    assert RUN_RULES.keys() <= read


def test_a_training_drives_by_rules_of_a_run_and_has_a_value_for_each_setting():
    assert {"direction", "race_type", "boxes"} < set(DRIVEN_BY) < RUN_RULES.keys()
    columns = {field.name for field in TrainingJob._meta.get_fields()}
    assert {field.name for field in dataclasses.fields(TrainingSettings)} <= columns


@pytest.mark.parametrize("name", ["max_resets", "minimum_laps"])
def test_a_rule_is_named_in_few_files(name):
    """What a rule is stands in the list; the others are those that decide by it and those that set a value."""
    rooms = [Path(paddock.__file__).parents[1] / room for room in (*ROOMS, "static", "templates")]
    files = [file for room in rooms for file in room.rglob("*.*") if file.suffix in (".py", ".html", ".js")]
    named = [
        str(file) for file in files if "migrations" not in file.parts and re.search(rf"\b{name}\b", file.read_text())
    ]
    assert "paddock/rules/race.py" in " ".join(named)
    assert len(named) <= 6, named
