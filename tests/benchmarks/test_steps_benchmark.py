"""Where a control step goes: all of it is told, part by part."""

from __future__ import annotations

import json

import pytest

from benchmarks import steps
from tests.benchmarks.running import run


@pytest.mark.slow
def test_the_parts_of_a_step_are_all_of_it() -> None:
    told = json.loads(
        run("benchmarks.steps", "--json", "--track", "oval", "--laps", "1", "--runs", "1", "--models", "steady")
    )
    (car,) = told["cars"].values()
    assert car["step"] == pytest.approx(sum(car[part] for part in steps.PARTS[1:]))
    assert car["steps"] > 50
    assert all(car[part] > 0 for part in steps.PARTS)
    assert car["own"] == pytest.approx((car["exchange"] + car["rest"]) / car["step"])
    assert "steady" in steps.table(told)
