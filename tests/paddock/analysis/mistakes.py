"""Cars that make one mistake in one turn of their second lap, and what the rules find: run it for the figures.

``python -m tests.paddock.analysis.mistakes`` prints precision and recall over all planted mistakes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from paddock.analysis.losses import Loss, Mistake, losses_of
from paddock.analysis.telemetry import DrivenTrace, LapTelemetry, lap_line, lap_telemetry
from paddock.analysis.turns import TrackTurn, turns_of
from paddock.geometry.catalogue import by_slug
from paddock.rules.race import RaceRules
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.sensors import POSE

TRACKS = ("reinvent-2018", "oval-track", "bowtie-track", "rl-speedway", "smile-speedway", "empire-city-training")
SPEED = 2.0  # at which the pilot repeats its laps to a few ms
LEAST_MS = 100  # a planted mistake costs as much, else there is nothing to report
EARLY_M, WIDE_M = 1.2, 0.3

# What the rules may call each planted mistake
SLOW, WIDE, LATE, EARLY, LATE_EXIT = "slow", "wide", "late", "early", "late exit"
NAMES = {
    SLOW: {Mistake.BRAKED_TOO_MUCH},
    WIDE: {Mistake.ENTERED_WIDE, Mistake.RAN_WIDE},
    LATE: {Mistake.TURNED_LATE},
    EARLY: {Mistake.BRAKED_EARLY},
    LATE_EXIT: {Mistake.ACCELERATED_LATE},
}
# Metres without another turn that a mistake needs before or after its turn, so that it is a mistake of that turn alone
ROOM_BEFORE, ROOM_AFTER = {WIDE: 2.0, EARLY: 2.0}, {LATE_EXIT: 2.6}


class MistakenPilot(CentreLinePilot):
    """Drives along the centre line and makes ``mistake`` in ``turn`` of every lap but the first. ``slowest``: m/s of a
    good lap in that turn."""

    def __init__(self, track, mistake: str = "", turn: TrackTurn | None = None, slowest: float = 0.0) -> None:
        super().__init__(track, track.direction, SPEED)
        self._mistake, self._turn, self._slowest = mistake, turn, slowest
        self._lap, self._before = 1, 0.0

    def _offset_for(self, metres: float, aim_m: float) -> float:
        turn = self._turn
        if self._mistake != WIDE or turn is None or self._lap < 2:
            return 0.0
        length = self._track.length
        into = (aim_m - turn.from_m + EARLY_M) % length
        outside = -1.0 if turn.degrees > 0 else 1.0
        return outside * WIDE_M if into < (turn.to_m - turn.from_m) % length + EARLY_M else 0.0

    def __call__(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        x, y, *_ = readings[POSE].tolist()
        action = super().__call__(readings)
        metres, length, turn = self._track.project(x, y, self._index).distance, self._track.length, self._turn
        self._lap += self._before - metres > length / 2
        self._before = metres
        if turn is None or self._lap < 2:
            return action
        least, most = PADDOCK_CAR.min_speed, PADDOCK_CAR.max_speed
        slowest = 2 * (self._slowest - least) / (most - least) - 1
        if self._mistake == SLOW and turn.contains((metres + 0.2) % length):
            action[1] -= 0.3  # 0.6 m/s
        elif self._mistake == LATE and (metres - turn.from_m + 0.4) % length < 1.0:
            action[0] = 0.0
        else:  # as slow as in the turn, too early or for too long
            to_go = {EARLY: turn.from_m - metres, LATE_EXIT: metres - turn.to_m}.get(self._mistake, -1.0) % length
            action[1] = min(action[1], slowest) if to_go < EARLY_M else action[1]
        return action


@cache
def track_named(slug: str):
    track = by_slug(slug).geometry()
    return track, turns_of(track, track.direction)


def drive(slug: str, *mistake, laps: int = 2):
    track, _ = track_named(slug)
    pilot = MistakenPilot(track, *mistake)
    rules = RaceRules(laps=laps, direction=track.direction)
    return run_race(RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)]))


def telemetry_of(slug: str, run, lap: int = 2) -> LapTelemetry:
    trace = DrivenTrace.of(run.trace.to_csv())
    line = lap_line(trace, [each.to_dict() for each in run.laps], lap)
    assert line is not None
    return lap_telemetry(trace, line, track_named(slug)[0])


@cache
def good_lap(slug: str) -> LapTelemetry:
    return telemetry_of(slug, drive(slug))


@dataclass(frozen=True)
class PlantedCase:
    """A planted mistake, the time it cost and the losses that the rules report."""

    slug: str
    mistake: str
    turn: TrackTurn
    cost_ms: int
    losses: list[Loss]

    @property
    def of_its_turn(self) -> list[Loss]:
        return [loss for loss in self.losses if loss.stretch.turn == self.turn]

    @property
    def is_named(self) -> bool:
        return any(reason in NAMES[self.mistake] for loss in self.of_its_turn for reason, _ in loss.reasons)


def planted(slug: str, mistakes=tuple(NAMES)) -> Iterator[PlantedCase]:
    """All cases of a track: mistakes that cost too little, or the car a reset, are left out."""
    (track, turns), good = track_named(slug), good_lap(slug)
    for mistake in mistakes:
        for index, turn in enumerate(turns):
            before, after = turns[index - 1], turns[(index + 1) % len(turns)]
            if (turn.from_m - before.to_m) % track.length < ROOM_BEFORE.get(mistake, 0.0):
                continue
            if (after.from_m - turn.to_m) % track.length < ROOM_AFTER.get(mistake, 0.0):
                continue
            inside = [turn.contains(metres % track.length) for metres in good.metres.tolist()]
            run = drive(slug, mistake, turn, float(good.driven_speed[inside].min()))
            lap = telemetry_of(slug, run)
            cost = lap.time_ms - good.time_ms
            if cost >= LEAST_MS and not any(each.resets for each in run.laps):
                yield PlantedCase(slug, mistake, turn, cost, losses_of(lap, good, turns))


def figures(cases: list[PlantedCase]) -> tuple[float, float, float]:
    """Precision (reported losses in the turn of the mistake), recall (mistakes reported in their turn), and the share
    of mistakes that are called by their name."""
    reported = sum(len(case.losses) for case in cases)
    right = sum(len(case.of_its_turn) for case in cases)
    found = sum(bool(case.of_its_turn) for case in cases)
    return right / reported, found / len(cases), sum(case.is_named for case in cases) / len(cases)


if __name__ == "__main__":
    everything = [case for slug in TRACKS for case in planted(slug)]
    for kind in NAMES:
        some = [case for case in everything if case.mistake == kind]
        print(kind, len(some), *(f"{figure:.3f}" for figure in figures(some)))
    print("all", len(everything), *(f"{figure:.3f}" for figure in figures(everything)))
