"""The eight drives of an audit: scripted, by the real simulator and referee."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import INNER, OBJECT_AVOIDANCE, OUTER, TIME_TRIAL, BoxPlace, RaceRules
from paddock.simulator.layout import EMPTY, lay_out
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.policies import CentreLinePilot
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.sensors import POSE

from ..laboratory.recorded_lap import params_along
from ..sandbox.function import Params

FAST, SLOW, OFF_LINE, ZIG_ZAG, CUTTING = "fast", "slow", "off_line", "zig_zag", "cutting"
CRASH, STANDING, CIRCLES = "crash", "standing", "circles"
DRIVES = (FAST, SLOW, OFF_LINE, ZIG_ZAG, CUTTING, CRASH, STANDING, CIRCLES)

_LAPS = (FAST, SLOW, OFF_LINE, ZIG_ZAG, CUTTING)
_SLOW_MPS, _CIRCLES_MPS = 1.0, 1.0
_FAST_MPS = (4.0, 3.0, 2.6, 2.3, 2.0, 1.8)
_SLOW_LAP_S = 54.0  # at most: an episode has 60 s
_BOXES = ((0.25, 0.45, INNER), (0.55, 0.8, OUTER))  # each on the straightest place between two shares of the lap
_AROUND_M = 2.0
_WEAVE_M = 1.6
_BEND = 0.35  # 1/m: a bend that is cut to the full


@dataclass(frozen=True)
class RecordedDrive:
    """One drive. ``states``: the params after each step, as a training has them; not to be changed. ``lap_ms``: None
    without a whole lap. ``ended``: the status of the last state. ``seconds``: driven."""

    name: str
    states: tuple[Params, ...]
    lap_ms: int | None
    ended: str
    seconds: float

    @property
    def steps(self) -> int:
        return len(self.states)

    @property
    def progress(self) -> float:
        """Percent of the lap at the end."""
        return float(self.states[-1]["progress"])

    @property
    def is_clean(self) -> bool:
        return all(state["all_wheels_on_track"] for state in self.states)

    @property
    def progress_per_second(self) -> float:
        return self.progress / self.seconds


class _LinePilot(CentreLinePilot):
    """Follows a line whose offset from the centre changes along the track; past boxes in the other lane."""

    line: Callable[[float], float]

    def _offset_for(self, metres: float, aim_m: float) -> float:
        self._offset = self.line(aim_m)
        return super()._offset_for(metres, aim_m)


class _LeavingPilot(CentreLinePilot):
    """After a tenth of the lap it steers off the road to the outside, or stays in the lane of the first box."""

    def __call__(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        x, y, _, _ = readings[POSE].tolist()
        metres = self._track.project(x, y).distance
        boxes, self._boxes = self._boxes, ()
        ccw = self._track.direction == "ccw"
        begun = 0.1 * self._track.length < metres < 0.9 * self._track.length
        if boxes and begun:
            left, right = self._track.half_widths_at(metres)
            self._offset = left / 2 if (boxes[0].lane == INNER) == ccw else -right / 2
        action = super().__call__(readings)
        self._boxes = boxes
        if begun and not boxes:
            action[:] = -0.7 if ccw else 0.7, 1.0
        return action


class _CirclingPilot(CentreLinePilot):
    """Keeps to the right for a metre, then turns the wheel fully to the left."""

    _turning = False

    def __call__(self, readings: dict[str, np.ndarray]) -> np.ndarray:
        action = super().__call__(readings)
        x, y, _, _ = readings[POSE].tolist()
        self._turning = self._turning or 1.0 < self._track.project(x, y).distance < self._track.length / 2
        if self._turning:
            action[0] = 1.0
        return action


def eight_drives(track: TrackGeometry, direction: str, race_type: str = TIME_TRIAL) -> tuple[RecordedDrive, ...]:
    """The :data:`DRIVES` on a track, under the rules of a training's episode: one lap, 60 s, the first fault ends it.
    The same every time; one to two seconds of processor time. With boxes for race types with objects. ``track`` as the
    catalogue has it."""
    rules = RaceRules.of_an_episode(direction=direction)
    if race_type != TIME_TRIAL:
        boxes = _boxes(track.in_direction(direction))
        try:
            rules = RaceRules.of_an_episode(direction=direction, race_type=OBJECT_AVOIDANCE, boxes=boxes)
            lay_out(track.in_direction(direction), rules)
        except UserFault:  # a track too short for boxes
            rules = RaceRules.of_an_episode(direction=direction)
    return tuple(_best(name, attempts, track, rules) for name, attempts in _attempts(track, rules).items())


def _boxes(driven: TrackGeometry) -> tuple[BoxPlace, ...]:
    def bend(share: float) -> float:
        headings = [driven.point_at(share * driven.length + metres)[2] for metres in (-_AROUND_M, 0.0, _AROUND_M)]
        return sum(abs(math.remainder(b - a, 2.0 * math.pi)) for a, b in pairwise(headings))

    shares = [number / 100 for number in range(100)]
    return tuple(
        BoxPlace(min((share for share in shares if first <= share <= last), key=bend), lane)
        for first, last, lane in _BOXES
    )


def _attempts(track: TrackGeometry, rules: RaceRules) -> dict[str, list[CentreLinePilot]]:
    """Pilots by the drive's name, the most daring first: a narrow or winding track is not mastered by each."""
    driven, direction = track.in_direction(rules.direction), rules.direction
    layout = lay_out(driven, rules) if rules.boxes else EMPTY
    width = track.width_at(0.0)
    waves = max(2, round(track.length / _WEAVE_M))

    def beside(metres: float, share: float) -> float:
        return share * width

    def weave(metres: float, share: float) -> float:
        return share * width * math.sin(2.0 * math.pi * waves * metres / track.length)

    def inside(metres: float, over_m: float) -> float:
        """From the centre to the inner border of a bend, as far as it bends."""
        before, after = driven.point_at(metres - 0.6)[2], driven.point_at(metres + 0.6)[2]
        bend = max(-1.0, min(1.0, math.remainder(after - before, 2.0 * math.pi) / 1.2 / _BEND))
        left, right = driven.half_widths_at(metres)
        return bend * ((left if bend > 0 else right) + over_m - PADDOCK_CAR.half_track)

    def along(line: Callable[[float], float], speed: float) -> CentreLinePilot:
        pilot = _LinePilot(track, direction, speed, layout=layout)
        pilot.line = line
        return pilot

    centre = partial(beside, share=0.0)
    milder = ((1.0, 2.0), (1.0, 1.5), (0.7, 1.5))  # share of the offset, m/s
    return {
        FAST: [along(centre, speed) for speed in _FAST_MPS],
        SLOW: [along(centre, max(_SLOW_MPS, track.length / _SLOW_LAP_S))],
        OFF_LINE: [along(partial(beside, share=0.3 * part), speed) for part, speed in milder],
        ZIG_ZAG: [along(partial(weave, share=0.22 * part), speed) for part, speed in milder],
        CUTTING: [along(partial(inside, over_m=over), speed) for speed in _FAST_MPS for over in (0.02, -0.03)],
        CRASH: [_LeavingPilot(track, direction, 2.0 if layout.boxes else 4.0, layout=layout)],
        STANDING: [along(centre, PADDOCK_CAR.min_speed)],
        CIRCLES: [_CirclingPilot(track, direction, _CIRCLES_MPS, -0.5 * width)],
    }


def _best(name: str, attempts: list[CentreLinePilot], track: TrackGeometry, rules: RaceRules) -> RecordedDrive:
    """The first attempt that is what the drive is called, else the last."""
    for pilot in attempts:
        drive = _drive(name, pilot, track, rules)
        if name not in _LAPS or (drive.lap_ms is not None and (name == CUTTING or drive.is_clean)):
            break
    return drive


def _drive(name: str, pilot: CentreLinePilot, track: TrackGeometry, rules: RaceRules) -> RecordedDrive:
    result = run_race(RaceSettings(track, rules, [Entrant(pilot.action_space, pilot.sensors, pilot)]))
    driven = track.in_direction(rules.direction)
    solids = [box.solid for box in lay_out(driven, rules).boxes] if rules.boxes else []
    states = params_along(driven, result.trace.columns, solids=solids)
    lap = result.laps[0]
    return RecordedDrive(
        name=name,
        states=tuple(states),
        lap_ms=lap.time_ms if lap.complete else None,
        ended=str(result.trace.columns["episode_status"][-1]),
        seconds=lap.time_ms / 1000.0,
    )
