"""The judge of one car in a time trial: progress, laps, sectors, faults and where a car is put back.

Rules: deepracer-simapp, reset/rules/*.py and agent_ctrl/rollout_agent_ctrl.py. Where this referee is stricter than the
original it says why.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from tracks.geometry import TrackGeometry

from .car import Pose
from .clock import milliseconds
from .physics import CarPhysics
from .progress import Odometer, Reach
from .rules import RaceRules, penalty_steps
from .trace import IMMOBILIZED, IN_PROGRESS, LAP_COMPLETE, OFF_TRACK, PAUSE, REVERSED, TIME_UP

SECTORS = 3  # virtual_event: three sectors a lap, here thirds of the length
PATIENCE_STEPS = 15  # reset/constants.py: steps until a car that stands or reverses is put back
STANDSTILL_M = 0.0003  # a step of at most this is no movement

LAPS_DONE, RESETS_USED = "laps_done", "resets_used"  # why a run ended; the third reason is TIME_UP

_FAULTS = {OFF_TRACK: "off_tracks", IMMOBILIZED: "immobilised", REVERSED: "reversals"}


@dataclass
class Lap:
    """One lap as it is driven. Times are milliseconds since the start of the run."""

    number: int
    start_ms: int
    end_ms: int | None = None  # None until the line is crossed
    off_tracks: int = 0
    crashes: int = 0
    resets: int = 0
    immobilised: int = 0
    reversals: int = 0
    sector_ends_ms: list[int] = field(default_factory=list)


class PutBack(NamedTuple):
    """Where a car goes after a fault, and how far along the track (unwrapped metres) that is."""

    pose: Pose
    metres: float


class Referee:
    """Judges one car after every control step; says its status and, after a fault, where to put it."""

    def __init__(
        self,
        track: TrackGeometry,
        rules: RaceRules,
        physics: CarPhysics,
        reach: Reach | None = None,
        start_m: float = 0.0,
        clear_m: float = 0.0,
    ) -> None:
        """``clear_m``: how near to the centre line everything is road (0.0: every wheel is looked at, always)."""
        self.track = track
        self.rules = rules
        self._physics = physics
        # No wheel is farther from the nose than the rear ones.
        self._wheel_m = math.hypot(physics.nose_x - physics.rear_axle_x, physics.half_track)
        self._clear_m = clear_m - self._wheel_m  # of the nose
        self.odometer = Odometer(track, reach or Reach(track))
        self._start_m = start_m
        self._off_track_steps = penalty_steps(rules.off_track_penalty_ms, physics.control_hz)
        self._time_limit = rules.max_simulated_ms
        self.step = 0
        self.status = IN_PROGRESS
        self.end_reason: str | None = None
        self.all_wheels_on_track = True
        self.resets = 0
        self.pause_steps = 0
        self.laps = [Lap(1, 0)]
        self.pose = Pose(*track.point_at(start_m))
        self._noses: tuple[tuple[float, float], ...] = ()
        self.place(self.pose, start_m)

    # --- what others read ---------------------------------------------------------------------------------------

    @property
    def lap(self) -> Lap:
        """The lap being driven; after the end, the last one."""
        return self.laps[-1]

    @property
    def done(self) -> bool:
        """True when the run is over."""
        return self.end_reason is not None

    @property
    def lap_start_m(self) -> float:
        """Unwrapped distance at which the current lap begins."""
        return self._start_m + (self.lap.number - 1) * self.track.length

    @property
    def percent(self) -> float:
        """Progress of the current lap in percent, at most 100; negative behind the start."""
        if self.lap.end_ms is not None:
            return 100.0
        return min(100.0, 100.0 * (self.odometer.metres - self.lap_start_m) / self.track.length)

    @property
    def time_ms(self) -> int:
        """Simulated milliseconds since the start; after all laps, those of the finish."""
        if self.end_reason == LAPS_DONE:
            assert self.lap.end_ms is not None
            return self.lap.end_ms
        return milliseconds(self.step)

    # --- judging --------------------------------------------------------------------------------------------------

    def place(self, pose: Pose, near_m: float) -> None:
        """The car was put at ``pose``, about ``near_m`` metres (unwrapped) from the finish; standing still."""
        nose = pose.ahead(self._physics.nose_x)
        self.odometer.put(*nose, near_m)
        self.pose = pose
        self._noses = (nose, nose)
        self._standing = self._reversing = 0
        self.all_wheels_on_track = all(self._wheels(pose))

    def wait(self) -> str:
        """One control step of a penalty has passed; only the time limit is judged."""
        self.step += 1
        self.pause_steps -= 1
        self.status = IN_PROGRESS if self.pause_steps <= 0 else PAUSE
        if milliseconds(self.step) >= self._time_limit:
            self._end(TIME_UP, TIME_UP)
        return self.status

    def judge(self, pose: Pose) -> PutBack | None:
        """The car drove one control step to ``pose``. Returns where to put it after a fault, else None: the caller then
        calls :meth:`place` with it and :meth:`wait` once a control step until ``pause_steps`` are over.

        Order of verdicts: time up, lap complete, (crashed,) off track, immobilised, reversed.
        """
        self.step += 1
        before_m, before = self.odometer.metres, self.pose
        nose = pose.ahead(self._physics.nose_x)
        self.odometer.move(*nose)
        metres = self.odometer.metres
        self.pose = pose

        moved = min(math.dist(nose, other) for other in self._noses)
        self._noses = (self._noses[1], nose)
        self._standing = self._standing + 1 if moved <= STANDSTILL_M else 0
        self._reversing = self._reversing + 1 if metres < before_m else 0
        clear = abs(self.odometer.seen.offset) < self._clear_m  # the common case, and four exact tests less
        wheels = () if clear else self._wheels(pose)
        self.all_wheels_on_track = all(wheels)

        if milliseconds(self.step) >= self._time_limit:
            self._end(TIME_UP, TIME_UP)
            return None
        if self.lap.end_ms is not None:
            self.laps.append(Lap(self.lap.number + 1, self.lap.end_ms))
        self._cross_lines(before_m, metres)
        if self.lap.end_ms is not None:
            if self.lap.number == self.rules.laps:
                self._end(LAPS_DONE, LAP_COMPLETE)
            else:
                self.status = LAP_COMPLETE
            return None
        if not clear and (not any(wheels) or self._elsewhere()):
            return self._fault(OFF_TRACK, before_m, before)
        if self._standing >= PATIENCE_STEPS:
            return self._fault(IMMOBILIZED, before_m, before)
        if self._reversing >= PATIENCE_STEPS:
            return self._fault(REVERSED, before_m, before)
        self.status = IN_PROGRESS
        return None

    def _wheels(self, pose: Pose) -> list[bool]:
        """For each wheel whether its centre is on the road."""
        physics, on_road = self._physics, self.track.on_road
        return [
            on_road(*pose.ahead(axle, side))
            for axle in (physics.front_axle_x, physics.rear_axle_x)
            for side in (physics.half_track, -physics.half_track)
        ]

    def _elsewhere(self) -> bool:
        """True where every wheel is beyond the border of the part of the road that the car is driving.

        The wheels may still be on the road, on another part of it that lies alongside. The original would let such a
        car drive on there; here it left the track.
        """
        seen = self.odometer.seen
        left, right = self.track.half_widths_at(seen.distance)
        return not -right - self._wheel_m <= seen.offset <= left + self._wheel_m

    def _cross_lines(self, before_m: float, metres: float) -> None:
        """Write down the sector and finish lines passed in this step, at the share of the step where it happened."""
        lap, length = self.lap, self.track.length
        while lap.end_ms is None:
            line = self.lap_start_m + length * (len(lap.sector_ends_ms) + 1) / SECTORS
            if metres < line:
                return
            share = (line - before_m) / (metres - before_m) if metres > before_m else 1.0
            at_ms = milliseconds(self.step - 1 + min(max(share, 0.0), 1.0))
            lap.sector_ends_ms.append(at_ms)
            if len(lap.sector_ends_ms) == SECTORS:
                lap.end_ms = at_ms

    def _fault(self, status: str, before_m: float, before: Pose) -> PutBack | None:
        self.status = status
        counter = _FAULTS[status]
        setattr(self.lap, counter, getattr(self.lap, counter) + 1)
        if self.resets >= self.rules.max_resets:
            self._end(RESETS_USED, status)
            return None
        self.resets += 1
        self.lap.resets += 1
        self.pause_steps = max(1, 0 if status == IMMOBILIZED else self._off_track_steps)
        return self._put_back(before_m, before)

    def _put_back(self, before_m: float, before: Pose) -> PutBack:
        """The centre of the lane nearer to the car one step ago, at the progress of that step (an off-track car may be
        nearer to another part of the track). Never so near to the line that the car would stand across it."""
        line = self.lap_start_m + self.track.length
        metres = min(before_m, line - self._physics.nose_x - 0.01)
        lanes = [Pose(*self.track.lane_centre(metres, lane)) for lane in ("inner", "outer")]
        pose = min(lanes, key=lambda lane: math.hypot(lane.x - before.x, lane.y - before.y))
        return PutBack(pose, metres)

    def _end(self, reason: str, status: str) -> None:
        self.end_reason = reason
        self.status = status
