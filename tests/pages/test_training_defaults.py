"""Who chooses SAC gets SAC's usual hyperparameters, and keeps what was typed."""

from __future__ import annotations

import re

import pytest

from tests.pages.conftest import World
from training.hyperparameters import DEFAULTS, RANGES

NUMBERS = [name for name in RANGES if name in DEFAULTS["ppo"] and name in DEFAULTS["sac"] and name != "batch_size"]


def page(world: World, query: str = "") -> str:
    return world.client("alice").get(f"/train/new/{query}").content.decode()


def shown(html: str, name: str) -> float:
    (tag,) = re.findall(rf'<input[^>]* name="{name}"[^>]*>', html)
    return float(re.search(r'value="([^"]*)"', tag)[1])


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
@pytest.mark.parametrize("name", NUMBERS)
def test_the_wizard_shows_what_is_usual_for_the_algorithm_that_an_address_names(world, algorithm, name):
    assert shown(page(world, f"?algorithm={algorithm}"), name) == DEFAULTS[algorithm][name]


def test_what_an_address_says_comes_before_what_is_usual(world):
    html = page(world, "?algorithm=sac&num_epochs=9")
    assert shown(html, "num_epochs") == 9
    assert '<option value="64" selected>' in html


def test_each_field_tells_the_script_what_is_usual(world):
    html = page(world)
    for name in (*NUMBERS, "batch_size", "loss_type"):
        (tag,) = re.findall(rf'<(?:input|select)[^>]* name="{name}"[^>]*>', html)
        for algorithm in ("ppo", "sac"):
            said = re.search(rf'data-{algorithm}="([^"]*)"', tag)[1]
            usual = DEFAULTS[algorithm][name]
            assert said == usual if isinstance(usual, str) else float(said) == usual
