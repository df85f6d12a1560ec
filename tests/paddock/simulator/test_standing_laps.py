"""Laps that are not driven in a row: after each one the car is put back to the start and begins anew from rest."""

from __future__ import annotations

import json
import math

import pytest

from paddock.geometry.catalogue import CATALOGUE
from paddock.rules.race import RaceRules
from paddock.simulator.physics import STEP_MS
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceResult, RaceSettings, run_race

TRACK = next(entry for entry in CATALOGUE if entry.slug == "oval").geometry()


def drive(cars: int = 1, start_m: float = 0.0, **rules) -> RaceResult:
    pilots = [CentreLinePilot(TRACK, speed=2.0) for _ in range(cars)]
    cars = [Entrant(pilot.action_space, pilot.sensors, pilot) for pilot in pilots]
    told = RaceRules(laps=3, start_m=start_m, **rules)
    return run_race(RaceSettings(TRACK, told, cars))


@pytest.fixture(scope="module")
def standing() -> RaceResult:
    return drive(standing_laps=True)


def test_every_lap_takes_as_long_as_the_first(standing):
    times = [lap.time_ms for lap in standing.laps]
    assert standing.end_reason == "laps_done"
    assert max(times) - min(times) <= 20
    rolling = [lap.time_ms for lap in drive().laps]
    assert rolling[0] == times[0]
    assert min(times[1:]) > max(rolling[1:]) + 50  # which begin at full speed


def test_a_lap_begins_at_rest_where_the_first_one_began(standing):
    trace = standing.trace
    for number in range(3):
        begins = int((trace["episode"] == number).argmax())
        place = trace["X"][begins], trace["Y"][begins]
        assert math.dist(place, (trace["X"][0], trace["Y"][0])) < 1e-6
        assert trace["progress"][begins] == pytest.approx(trace["progress"][0], abs=1e-6)
        moved = math.dist(place, (trace["X"][begins + 1], trace["Y"][begins + 1]))
        assert moved < 0.02  # at 2 m/s it would be seven times as far


def test_the_way_back_is_no_fault_and_no_part_of_a_lap(standing):
    assert not any(lap.resets or lap.crashes or lap.off_tracks for lap in standing.laps)
    for before, after in zip(standing.laps, standing.laps[1:], strict=False):
        assert 0.0 <= after.start_ms - before.start_ms - before.time_ms <= 2 * STEP_MS
    assert (standing.trace["episode_status"] == "lap_complete").sum() == 3


def test_a_run_repeats_itself(standing):
    assert drive(standing_laps=True).trace.sha256 == standing.trace.sha256


def test_laps_of_a_run_that_starts_elsewhere_begin_there_again():
    trace = drive(start_m=5.0, standing_laps=True).trace
    for number in (1, 2):
        begins = int((trace["episode"] == number).argmax())
        assert math.dist((trace["X"][begins], trace["Y"][begins]), (trace["X"][0], trace["Y"][0])) < 1e-6


@pytest.mark.parametrize(
    "rules",
    [
        {"race_type": "object_avoidance", "random_boxes": 3, "seed": 5, "max_simulated_ms": 90_000},
        {"race_type": "head_to_head", "bots": 2, "bot_speed_mps": 1.0, "max_simulated_ms": 90_000},
    ],
    ids=["boxes", "bots"],
)
def test_it_goes_with_boxes_and_bots(rules):
    result = drive(standing_laps=True, **rules)
    assert len(result.laps) >= 2
    assert result.laps[0].complete


def test_two_cars_each_begin_their_laps_anew():
    result = drive(cars=2, race_type="head_to_head", standing_laps=True, max_simulated_ms=120_000)
    for car in (result, *result.rivals):
        assert [lap.complete for lap in car.laps] == [True] * 3
        assert car.laps[1].time_ms > car.laps[0].time_ms - 1500


def test_rules_without_it_do_not_name_it():
    assert "standing_laps" not in RaceRules().to_dict()
    told = RaceRules(standing_laps=True)
    assert RaceRules.from_dict(json.loads(json.dumps(told.to_dict()))) == told
    with pytest.raises(ValueError, match="standing_laps"):
        RaceRules(standing_laps=1)
