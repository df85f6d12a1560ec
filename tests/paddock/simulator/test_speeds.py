"""Speeds that a racer commands during a run: when they act, on whom, and that the run can be proven with them."""

from __future__ import annotations

import numpy as np
import pytest

from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules
from paddock.rules.speed import SpeedCommand
from paddock.simulator.own import drive_again
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceResult, RaceSettings, run_race

OVAL = by_slug("oval").geometry()
CAP = SpeedCommand(2000, "cap", 0.8)
FREE = SpeedCommand(4000, "model_speed")


def driven(*commands: SpeedCommand, cars: int = 1) -> RaceResult:
    pilots = [CentreLinePilot(OVAL, speed=1.5) for _ in range(cars)]
    cars = [Entrant(pilot.action_space, pilot.sensors, pilot) for pilot in pilots]
    race_type = "time_trial" if cars == 1 else "head_to_head"
    rules = RaceRules(race_type=race_type, max_simulated_ms=6000, speed_commands=commands)
    return run_race(RaceSettings(OVAL, rules, cars))


def test_a_command_acts_from_its_time_until_the_next_one():
    trace = driven(CAP, FREE).trace
    speeds, before = trace["throttle"], trace["tstamp"]
    capped = (before >= 2.0) & (before < 4.0)
    assert np.all(speeds[capped][:-1] == 0.8)
    assert np.all(speeds[~capped][:-1] > 0.8)


def test_what_was_driven_before_a_command_is_as_without_it_to_the_bit():
    with_it, without = driven(CAP).trace, driven().trace
    until = int(np.searchsorted(without["tstamp"], 2.0))
    assert all(np.array_equal(with_it[name][:until], without[name][:until]) for name in ("X", "Y", "yaw", "throttle"))
    assert with_it.sha256 != without.sha256


def test_a_command_is_for_one_car_of_several():
    result = driven(SpeedCommand(0, "multiplier", 0.5, car=1), cars=2)
    assert result.rivals[0].trace["throttle"][5] == 0.5 * result.trace["throttle"][5]


def test_the_same_log_gives_the_same_run_and_its_trace_proves_it():
    once, again = driven(CAP, FREE), driven(CAP, FREE)
    assert once.trace.sha256 == again.trace.sha256
    rules = RaceRules(max_simulated_ms=6000, speed_commands=(CAP, FREE))
    assert drive_again(OVAL, rules, [once.trace.to_csv()]).trace.sha256 == once.trace.sha256


def test_a_command_to_a_car_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="name car 1, and there are 1"):
        driven(SpeedCommand(0, "cap", 1.0, car=1))
