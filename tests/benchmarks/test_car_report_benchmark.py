"""A hundred variations of a lap of the oval within a minute on one core."""

from __future__ import annotations

import json

import pytest

from benchmarks import car_report
from tests.benchmarks.running import run


@pytest.mark.soak
def test_a_hundred_variations_of_a_house_car_take_less_than_a_minute() -> None:
    figures = json.loads(run("benchmarks.car_report", "--json", "--models", "flyer", may_miss=True))
    (car,) = figures["cars"].values()
    assert car["cpu_s"] < car_report.MOST_S and car["completed"] >= 90 and car["grade"] in ("A", "B")
    assert figures["variations"] == 100 and car["simulated_s"] > 300
    assert "flyer" in car_report.table(figures)


@pytest.mark.parametrize(("wall_s", "missed"), [(59.9, 0), (60.1, 1)])
def test_a_broken_promise_is_named(wall_s: float, missed: int) -> None:
    figures = {"track": "oval", "cars": {"flyer": {"wall_s": wall_s}, "console": {"wall_s": 500.0}}}
    assert len(car_report.misses(figures)) == missed
