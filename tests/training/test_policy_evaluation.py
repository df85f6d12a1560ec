"""The look at the car between updates: trials, laps in a row, and probes of the places where it failed last.

What drives is a pilot that knows the track, so that the test says where it fails.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from paddock.geometry.catalogue import by_slug
from paddock.simulator.envs.drive import Drive
from paddock.simulator.rewards import follow_centre_line
from tests.training.specs import a_spec

pytest.importorskip("stable_baselines3", reason="training is not installed: make training")

from training.trainer import policy_evaluation as judging
from training.trainer.network import NetworkLayout
from training.trainer.policy_evaluation import PROBE_BEFORE_M, Judge

TRACK = by_slug("oval").geometry()
SPEC = a_spec(TRACK, stop_clean_laps=3)
AHEAD_M = 0.6
FAILING_M = 2.5
LAPS_AND_TRIALS = 3 + 2  # three by the first car, of which one is its trial, and one by each of two others


class Pilot(Drive):
    """Follows the centre line, whatever the policy says, and turns off the road behind ``fails_m`` metres of the track,
    in the laps that ``fails_in`` says."""

    fails_m: float | None = None
    fails_in: tuple[int, ...] = (1, 2, 3)
    steps = 0
    begun: list[float]

    def begin(self, rng: Any, options: Any = None) -> dict[str, Any]:
        Pilot.begun.append(options["start_m"])
        return super().begin(rng, options)

    def command(self, action: Any) -> None:
        Pilot.steps += 1
        referee = self.car.referee
        metres = referee.odometer.metres
        x, y, _ = TRACK.point_at(TRACK.along(metres + AHEAD_M))
        bearing = math.atan2(y - referee.pose.y, x - referee.pose.x)
        wanted = math.degrees(math.remainder(bearing - referee.pose.yaw, math.tau))
        beyond = self.fails_m is not None and 0.0 < metres % TRACK.length - self.fails_m < FAILING_M
        if beyond and referee.lap.number in self.fails_in:
            wanted = -30.0
        space = self._setting.actions
        super().command(min(range(space.size), key=lambda index: abs(space.actions[index][0] - wanted)))


@pytest.fixture
def judge(monkeypatch):
    monkeypatch.setattr(judging, "Drive", Pilot)
    monkeypatch.setattr(Pilot, "steps", 0)
    monkeypatch.setattr(Pilot, "begun", [], raising=False)
    made = Judge(SPEC, TRACK, [follow_centre_line] * SPEC.trials_driven, list(NetworkLayout.of(SPEC.metadata).senses))
    yield made
    made.close()


def act(rows: np.ndarray) -> np.ndarray:
    return np.zeros((len(rows), len(SPEC.metadata["action_space"])), np.float32)


def test_the_first_trial_is_the_first_of_the_laps_in_a_row(judge):
    verdict = judge.look(act)
    assert verdict.confirmed and verdict.clean_laps == 3 and not verdict.faults
    laps = [lap.end_ms - lap.start_ms for lap in judge._drives[0].car.referee.laps]
    assert len(laps) == 3 and verdict.trials[0]["lap_ms"] == laps[0]
    assert [trial["status"] for trial in verdict.trials] == ["Lap complete"] * 3
    assert [trial["time_ms"] for trial in verdict.trials] == [trial["lap_ms"] for trial in verdict.trials]
    steps = [trial["steps"] for trial in verdict.trials]
    assert all(trial["reward"] <= trial["steps"] for trial in verdict.trials), "the reward of one lap"
    assert sum(steps) < Pilot.steps < sum(steps) * LAPS_AND_TRIALS / 3, "the standing lap takes longest"
    assert len(verdict.driving) <= steps[0]


def test_a_fault_in_a_later_lap_is_none_of_the_trial(judge, monkeypatch):
    monkeypatch.setattr(Pilot, "fails_m", 2.0)
    monkeypatch.setattr(Pilot, "fails_in", (3,))
    verdict = judge.look(act)
    assert verdict.clean_laps == 3 and not verdict.confirmed
    ((way, metres),) = verdict.faults
    assert way == 0 and 2.0 < metres < 4.6


def test_nothing_is_confirmed_where_a_trial_failed(judge, monkeypatch):
    monkeypatch.setattr(Pilot, "fails_m", 2.0)
    verdict = judge.look(act)
    assert not verdict.confirmed and verdict.clean_laps == 0 and verdict.lap_ms is None
    assert len(verdict.faults) == 3 and all(2.0 < metres < 4.6 for _, metres in verdict.faults)
    assert judge._drives[0].car.referee.lap.number == 1


def test_a_trial_has_the_time_of_one_lap(judge, monkeypatch):
    monkeypatch.setattr(judge, "_limits_ms", [1_000] * 3)
    verdict = judge.look(act)
    assert [trial["status"] for trial in verdict.trials] == ["Time Up"] * 3
    assert [trial["lap_ms"] for trial in verdict.trials] == [None] * 3
    assert not verdict.faults and not verdict.confirmed


def test_places_that_the_car_takes_now_pass_the_probe(judge, monkeypatch):
    assert judge.probe(act) == (), "before a look there is nothing to probe"
    monkeypatch.setattr(Pilot, "fails_m", 2.0)
    ((_, metres), *_) = judge.look(act).faults
    Pilot.begun.clear()
    looked, Pilot.steps = Pilot.steps, 0
    failed = judge.probe(act)
    assert len(Pilot.begun) == 1, "three trials failed in one place"
    assert Pilot.begun[0] == pytest.approx((metres - PROBE_BEFORE_M) % TRACK.length)
    assert failed == failed[:1] * 3 and failed[0][0] == 0 and 2.0 < failed[0][1] < 4.6
    assert 0 < Pilot.steps < looked / 2
    Pilot.steps = 0
    monkeypatch.setattr(Pilot, "fails_m", None)
    assert judge.probe(act) == ()
    assert 0 < Pilot.steps <= 90, "it ends beyond the place"
    assert judge.look(act).confirmed
