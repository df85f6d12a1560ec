"""docs/racers.md names the hyperparameters as they are checked."""

from __future__ import annotations

import re

import pytest

from paddock.rules.hyperparameters import DEFAULTS, HYPERPARAMETERS

from .pages import section, text


@pytest.mark.parametrize("name", [name for name, one in HYPERPARAMETERS.items() if not one.choices])
def test_every_hyperparameter_has_a_range_and_defaults(name):
    page = section(text("racers.md"), "## How a training learns")
    (row,) = re.findall(rf"^\| `{name}` \| (.+?) \| (.+?) \|", page, re.M)
    low, high = (float(end) for end in row[0].split(" to "))
    assert (low, high) == (HYPERPARAMETERS[name].least, HYPERPARAMETERS[name].most)
    said = [float(value) for value in row[1].split(", ")]
    defaults = [DEFAULTS[algorithm][name] for algorithm in ("ppo", "sac") if name in DEFAULTS[algorithm]]
    assert (said if len(said) == len(defaults) else said * len(defaults)) == defaults
