"""Boxes and bots as replay and video draw them: where the referee saw a crash, the car touches one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paddock.rules.race import BoxPlace, RaceRules
from paddock.simulator.car import Pose
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.solids import cars_touch
from races.replays.document import bot_columns, trace_columns
from tests.paddock.simulator.tracks_for_tests import stadium
from videos.drawing.motion import read_steps

TRACK = stadium()
NEAR_M = 0.05  # a car is stopped within the step in which it touches
LAYOUTS = {
    "fixed boxes": {"race_type": "object_avoidance", "boxes": (BoxPlace(0.3, "inner"), BoxPlace(0.6, "outer"))},
    "drawn boxes": {"race_type": "object_avoidance", "random_boxes": 4},
    "bots that change lanes": {"race_type": "head_to_head", "bots": 3, "bot_speed_mps": 0.6, "bot_lane_changes": True},
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_crash_is_drawn_as_a_touch(layout):
    rules = RaceRules(laps=2, **LAYOUTS[layout])
    pilot = CentreLinePilot(TRACK, rules.direction, speed=2.0, offset=0.1)
    result = run_race(RaceSettings(TRACK, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)]))
    trace = result.trace.to_csv()
    drawn = {**trace_columns(trace), "bots": [bot_columns(places) for places in result.layout["bots"]]}
    assert [len(bot["x"]) for bot in drawn["bots"]] == [len(drawn["t"])] * rules.bots
    crashes = [
        step
        for step, status in enumerate(drawn["status"])
        if status == "crashed" and drawn["status"][step - 1] != "crashed"
    ]
    assert crashes, "nobody touched anything"
    middles = [middle(drawn, step) for step in range(len(drawn["t"]))]
    for step in crashes:
        others = [place(bot, step) for bot in drawn["bots"]]
        boxes = [Pose(box["x"], box["y"], box["yaw"]) for box in result.layout["boxes"]]
        near = [cars_touch(middles[step], other, NEAR_M) for other in others]
        near += [math.dist(middles[step][:2], box[:2]) < 0.25 + 0.19 + NEAR_M for box in boxes]
        assert any(near), (step, drawn["t"][step])
    steps = read_steps(trace)
    filmed = np.stack([steps.x, steps.y], axis=1)
    assert np.abs(filmed - np.array([pose[:2] for pose in middles])).max() < 0.003


def place(columns, step: int) -> Pose:
    return Pose(columns["x"][step], columns["y"][step], math.radians(columns["yaw"][step]))


def middle(columns, step: int) -> Pose:
    """A trace has the nose; pages draw the car around its middle."""
    at = place(columns, step)
    return Pose(*at.ahead(-PADDOCK_CAR.nose_x), at.yaw)
