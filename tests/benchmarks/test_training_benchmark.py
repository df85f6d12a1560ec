"""The benchmark of training says what it measured, and what of the promises it breaks."""

from __future__ import annotations

import json

import pytest

from benchmarks import racing_pace, training


def figures(
    wall_s: float = 12.0, lapped: int = 5, car_racing: float | None = 100.0, near_s: float | None = 60.0, near: int = 5
) -> dict:
    run = {"wall_s": wall_s}
    medians = {"wall_s": wall_s, "cpu_s": 9.0, "start_s": 2.0, "steps": 6000, "steps_per_second": 900.0}
    laps = {**medians, "lapped": lapped, "runs": [run] * 5}
    line = {
        "speed_limit_mps": 3.0,
        "line_lap_s": 6.57,
        "near": 1.25,
        "wanted_lap_s": 8.21,
        "budget_s": 300.0,
        "budget_in": "wall time",
        "wall_s": near_s,
        "cpu_s": near_s,
        "steps": near_s and 20_000,
        "lap_s": near_s and 7.5,
        "reached": near,
        "runs": [{"reached": number < near, "wall_s": 60.0} for number in range(5)],
    }
    return {
        "machine": {"cpu": "test", "cores": 2, "load_before": 0.1, "load_after": 0.2, "engine": "paddock-v1"},
        "seeds": 5,
        "first_three_clean_laps": {"oval": laps},
        "near_the_racing_line": {"oval": line},
        "first_three_clean_laps_of_sac": {"oval": laps},
        "steps_per_second": {
            "paddock": 900.0,
            "car_racing": car_racing,
            "ratio": car_racing and 9.0,
            "paddock_per_cpu_s": 600.0,
            "car_racing_per_cpu_s": car_racing,
            "ratio_per_cpu_s": car_racing and 6.0,
        },
    }


def test_kept_promises_are_reported():
    assert training.misses(figures()) == []
    table = training.table(figures())
    assert "Every target is met." in table
    assert "9.0 times as many" in table
    assert "within 25% of the lap of the minimum-curvature line" in table
    assert "The same with SAC" in table


def test_broken_promises_are_reported():
    assert "20 s are promised" in training.misses(figures(wall_s=21.0))[0]
    slow = training.misses(figures(lapped=4))
    assert "4 of 5 trainings drove" in slow[0]
    assert "4 of 5 trainings of SAC" in slow[1]
    assert "Missed: oval" in training.table(figures(wall_s=21.0))


def test_cars_not_near_the_line_in_time_are_reported():
    assert training.misses(figures(near=4)) == ["oval: 4 of 5 trainings came within 25% of the racing line"]
    assert "not within 25% of the racing line in 300 s" in training.misses(figures(near_s=301.0))[0]
    never = figures(near_s=None, near=1)
    assert len(training.misses(never)) == 2
    assert "60 - - - -" in training.table(never)


def test_a_missing_box2d_says_how_to_install_it():
    table = training.table(figures(car_racing=None))
    assert "CarRacing not measured" in table
    assert "pip install '.[bench]'" in table


@pytest.mark.parametrize("limit", ["0", "4.1", "nan"])
def test_a_speed_limit_beyond_the_car_is_refused(limit, capsys):
    with pytest.raises(SystemExit):
        training.main(["--speed-limit", limit])
    assert "0.1 to 4 m/s" in capsys.readouterr().err


@pytest.mark.soak
def test_car_racing_is_measured_where_box2d_is_installed():
    pytest.importorskip("Box2D", reason="pip install '.[bench]'")
    pytest.importorskip("torch", reason="training is not installed: make training")
    assert training.car_racing(512)["steps_per_second"] > 1


@pytest.mark.soak
def test_a_training_is_measured_from_start_to_laps(capsys):
    pytest.importorskip("torch", reason="training is not installed: make training")
    assert (
        training.main(["--tracks", "oval", "--seeds", "1", "--compared-steps", "0", "--parts", "laps", "--json"]) == 0
    )
    found = json.loads(capsys.readouterr().out)["first_three_clean_laps"]["oval"]
    (run,) = found["runs"]
    assert run["lapped"] and run["clean_laps_in_an_evaluation"] == 3
    assert 0 < run["start_s"] < run["wall_s"]
    assert run["cpu_s"] > 1.0


@pytest.mark.soak
def test_a_training_to_pace_ends_when_its_budget_is_spent():
    pytest.importorskip("torch", reason="training is not installed: make training")
    run = racing_pace.to_pace("oval", training.wizard_spec, 0, by_cpu=True, budget_s=1.0)
    assert (run["reached"], run["lap_s"], run["steps"]) == (False, None, None)
    assert run["cpu_s"] >= 1.0


@pytest.mark.soak
def test_an_evaluation_decides_what_is_near_the_line():
    pytest.importorskip("torch", reason="training is not installed: make training")
    run = racing_pace.to_pace("oval", training.wizard_spec, 0, by_cpu=True, near=3.0)  # whoever laps at all
    assert run["reached"] and run["evaluations"] >= 1
    assert 0.9 < run["of_line"] <= 3.0, "the line bends least, and need not be the fastest"
    assert run["lap_s"] == pytest.approx(run["of_line"] * racing_pace.line_of("oval").lap_s(3.0))
