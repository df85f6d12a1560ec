"""Driving without the site: a race from the commands in its traces alone is the race that they were recorded in."""

from __future__ import annotations

from dataclasses import replace

import pytest

from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules
from paddock.simulator.own import RecordedCommands, drive_again
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceResult, RaceSettings, run_race

OVAL = by_slug("oval").geometry()


def driven(rules: RaceRules, *offsets: float) -> RaceResult:
    """A race of scripted drivers, each beside the centre line by so many metres."""
    pilots = [CentreLinePilot(OVAL, offset=offset) for offset in offsets]
    cars = [Entrant(pilot.action_space, pilot.sensors, pilot) for pilot in pilots]
    return run_race(RaceSettings(OVAL, rules, cars))


def hashes(result: RaceResult) -> list[str]:
    return [car.trace.sha256 for car in (result, *result.rivals)]


@pytest.mark.parametrize(
    ("rules", "offsets"),
    [
        (RaceRules(max_simulated_ms=4000), (0.0,)),
        (RaceRules(max_simulated_ms=6000), (0.9,)),  # off the road, and put back
        (RaceRules(race_type="object_avoidance", random_boxes=6, max_simulated_ms=5000), (0.2,)),  # into boxes
        (RaceRules(race_type="head_to_head", bots=2, bot_lane_changes=True, max_simulated_ms=4000), (0.0,)),
        (RaceRules(race_type="head_to_head", max_simulated_ms=4000), (0.1, -0.1, 0.0)),
    ],
    ids=["alone", "put back", "boxes", "bots", "rivals"],
)
def test_the_commands_of_a_race_give_the_same_race(rules, offsets):
    before = driven(rules, *offsets)
    again = drive_again(OVAL, rules, [car.trace.to_csv() for car in (before, *before.rivals)])
    assert hashes(again) == hashes(before)
    assert (again.laps, again.order, again.end_reason) == (before.laps, before.order, before.end_reason)


def test_a_changed_command_or_another_rule_does_not():
    rules = RaceRules(max_simulated_ms=6000)
    before = driven(rules, 0.9)
    trace = before.trace.to_csv()
    lines = trace.split(b"\n")
    cells = lines[5].split(b",")
    cells[5] = b"12.5"  # the steering of one step
    changed = b"\n".join([*lines[:5], b",".join(cells), *lines[6:]])
    assert hashes(drive_again(OVAL, rules, [changed])) != hashes(before)
    assert hashes(drive_again(OVAL, replace(rules, off_track_penalty_ms=1000), [trace])) != hashes(before)


def test_a_trace_that_was_cut_off_ends_otherwise():
    rules = RaceRules(max_simulated_ms=3000)
    before = driven(rules, 0.0)
    lines = before.trace.to_csv().split(b"\n")
    assert hashes(drive_again(OVAL, rules, [b"\n".join(lines[:20])])) != hashes(before)


@pytest.mark.parametrize("text", [b"", b"X,Y\n1,2\n", b"\xff\xfe", b"steer,throttle,action\nleft,1,0\n"])
def test_what_is_no_trace_is_refused(text):
    with pytest.raises(ValueError):
        RecordedCommands.of_trace(text)
