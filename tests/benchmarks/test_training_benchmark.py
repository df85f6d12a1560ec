"""The benchmark of training says what it measured, and what of the promises it breaks."""

from __future__ import annotations

import json

import pytest

from benchmarks import training


def figures(wall_s: float = 12.0, lapped: int = 5, car_racing: float | None = 100.0) -> dict:
    run = {"wall_s": wall_s}
    medians = {"wall_s": wall_s, "cpu_s": 9.0, "start_s": 2.0, "steps": 6000, "steps_per_second": 900.0}
    return {
        "machine": {"cpu": "test", "cores": 2, "load_before": 0.1, "load_after": 0.2, "engine": "paddock-v1"},
        "seeds": 5,
        "first_three_clean_laps": {"oval": {**medians, "lapped": lapped, "runs": [run] * 5}},
        "steps_per_second": {"paddock": 900.0, "car_racing": car_racing, "ratio": car_racing and 9.0},
    }


def test_kept_promises_are_said():
    assert training.misses(figures()) == []
    assert "Every target is met." in training.table(figures())
    assert "9.0 times as many" in training.table(figures())


def test_broken_promises_are_said():
    assert "20 s are promised" in training.misses(figures(wall_s=21.0))[0]
    assert "4 of 5 trainings" in training.misses(figures(lapped=4))[0]
    assert "Missed: oval" in training.table(figures(wall_s=21.0))


def test_without_box2d_that_is_said():
    assert "CarRacing not measured" in training.table(figures(car_racing=None))


@pytest.mark.slow
def test_one_training_is_measured_from_start_to_laps(capsys):
    pytest.importorskip("torch", reason="training is not installed: make training")
    assert training.main(["--tracks", "oval", "--seeds", "1", "--compared-steps", "0", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["first_three_clean_laps"]["oval"]
    (run,) = found["runs"]
    assert run["lapped"] and run["clean_laps_in_an_evaluation"] == 3
    assert 0 < run["start_s"] < run["wall_s"]
    assert run["cpu_s"] > 1.0
