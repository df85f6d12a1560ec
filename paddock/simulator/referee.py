"""The referee of one car: progress, laps, sectors, faults and resets."""

# Rules: deepracer-simapp, reset/rules/*.py and agent_ctrl/rollout_agent_ctrl.py.

import math
from collections.abc import Callable
from typing import NamedTuple

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import INNER, LANES, OUTER, RaceRules, penalty_steps

from .boxes import BEYOND_M, BoxWatch
from .car import Pose
from .layout import EMPTY, Layout, other_lane
from .physics import STEP_MS, CarPhysics, milliseconds
from .progress import Odometer, Reach
from .results import Lap
from .trace import CRASHED, IMMOBILIZED, IN_PROGRESS, LAP_COMPLETE, OFF_TRACK, PARK, PAUSE, REVERSED, TIME_UP

SECTORS = 3  # virtual_event: three sectors a lap, here thirds of the length
PATIENCE_STEPS = 15  # reset/constants.py: steps until a car that stands or reverses is reset
STANDSTILL_M = 0.0003  # a step of at most this is no movement
SURELY_M = 2 * STANDSTILL_M  # a step of more than this along one axis is movement, however distances are rounded

# Why a run ended; the other reason is TIME_UP. Only a car among others retires.
LAPS_DONE, RESETS_USED, RETIRED = "laps_done", "resets_used", "retired"

_FAULTS = {CRASHED: "crashes", OFF_TRACK: "off_tracks", IMMOBILIZED: "immobilised", REVERSED: "reversals"}

_SEARCH_M, _SEARCH_STEP_M = 6.0, 0.1  # the search for a free place around the proper one


class PutBack(NamedTuple):
    """The new place of a car after a fault, and its unwrapped metres along the track."""

    pose: Pose
    metres: float


class Referee:
    """Judges one car after every control step; gives its status and, after a fault, its new place."""

    def __init__(
        self,
        track: TrackGeometry,
        rules: RaceRules,
        physics: CarPhysics,
        reach: Reach | None = None,
        start_m: float = 0.0,
        clear_m: float = 0.0,
        *,
        layout: Layout = EMPTY,
        free: Callable[[Pose], bool] = lambda pose: True,
        grid: int | None = None,
    ) -> None:
        """``start_m``: the line of this run, metres after the track's finish; on an open track, whose lines stay at its
        ends, the start of the first lap. ``clear_m``: the distance from the centre line within which everything is road
        (0.0: every wheel is checked). ``free``: whether a place is free of other cars. ``grid``: the car's place on the
        starting grid; None for a start on the line."""
        self.track = track
        self.rules = rules
        self._physics = physics
        self._nose_x = physics.nose_x
        # the rear wheels are the farthest from the nose
        self._wheel_m = math.hypot(physics.nose_x - physics.rear_axle_x, physics.half_track)
        self._clear_m = clear_m - self._wheel_m  # of the nose
        self._clear_from, self._clear_to = -math.inf, math.inf
        if track.is_open:
            self._clear_from, self._clear_to = track.paved[0] + self._wheel_m, track.paved[1]
        self.odometer = Odometer(track, reach or Reach(track))
        self.start_m = 0.0 if track.is_open else start_m
        self._penalties = {
            CRASHED: penalty_steps(rules.collision_penalty_ms, physics.control_hz),
            OFF_TRACK: penalty_steps(rules.off_track_penalty_ms, physics.control_hz),
            REVERSED: penalty_steps(rules.off_track_penalty_ms, physics.control_hz),
            IMMOBILIZED: 0,
        }
        self._last_step = math.ceil((rules.max_simulated_ms - 0.5) / STEP_MS)
        self.step = 0
        self.status = IN_PROGRESS
        self.end_reason: str | None = None
        self.all_wheels_on_track = True
        self.resets = 0
        self.crashes = 0
        self.pause_steps = 0
        self.laps = [Lap(1, 0)]
        self._free = free
        self._owed = False
        self.boxes = BoxWatch(layout, track.length, rules.mercy_resets, start_m + physics.nose_x)
        self.noses: tuple[tuple[float, float], ...] = ()
        start = self._start(start_m, grid)
        self.place(*start)
        self._before_m, self._before = self.odometer.metres, start.pose
        self._clear = False
        self._wheels_on: list[bool] = []
        self.line_m = self._next_line()

    @property
    def lap(self) -> Lap:
        """The present lap; after the end, the last one."""
        return self.laps[-1]

    @property
    def done(self) -> bool:
        return self.end_reason is not None

    @property
    def lap_start_m(self) -> float:
        """Unwrapped distance at which the current lap begins."""
        return self.start_m + (self.laps[-1].number - 1) * self.track.length

    @property
    def percent(self) -> float:
        """Progress of the current lap in percent, at most 100; negative behind the start."""
        lap, length = self.laps[-1], self.track.length
        if lap.end_ms is not None:
            return 100.0
        return min(100.0, 100.0 * (self.odometer.metres - self.lap_start_m) / length)

    @property
    def time_ms(self) -> int:
        """Simulated milliseconds since the start; after all laps, those of the finish."""
        if self.end_reason == LAPS_DONE:
            assert self.lap.end_ms is not None
            return self.lap.end_ms
        return milliseconds(self.step)

    def constants(self) -> dict[str, float]:
        """The constants of a run for :mod:`.cruise`."""
        physics = self._physics
        return {
            **{"nose_m": self._nose_x, "front_m": physics.front_axle_x, "rear_m": physics.rear_axle_x},
            **{"side_m": physics.half_track, "last_step": self._last_step},
            **{"clear_m": self._clear_m, "clear_from": self._clear_from, "clear_to": self._clear_to},
        }

    @property
    def is_calm(self) -> bool:
        """Whether the car is on a lap without a pause, a fault or an uncredited place."""
        odometer = self.odometer
        return (
            self.end_reason is None
            and self.pause_steps <= 0
            and self.laps[-1].end_ms is None
            and not self._owed
            and odometer.place is odometer.seen
        )

    def cruised(
        self,
        *,
        step: int,
        poses: tuple[Pose, Pose],
        noses: tuple[tuple[float, float], tuple[float, float]],
        before_m: float,
        reversing: int,
        clear: bool,
        wheels: list[bool],
        all_wheels: bool,
    ) -> None:
        """The car drove to its present place without an event. ``poses``, ``noses``: a step ago and now; ``wheels``: of
        a car that is not ``clear`` of the borders, whether each is on the road."""
        self.step, self.reversing, self._standing, self._before_m = step, reversing, 0, before_m
        (self._before, self.pose), self.noses, self.nose = poses, noses, noses[1]
        self._clear, self._wheels_on, self.all_wheels_on_track = clear, wheels, all_wheels

    def place(self, pose: Pose, near_m: float) -> None:
        """The car was placed at ``pose``, about ``near_m`` metres (unwrapped) from the finish, standing still."""
        self.nose = nose = pose.ahead(self._physics.nose_x)
        self.odometer.put(*nose, near_m)
        self.pose = pose
        self.noses = (nose, nose)
        self._standing = self.reversing = 0
        self.all_wheels_on_track = all(self.wheels(pose))

    def begin_at(self, pose: Pose) -> None:
        """The run begins at ``pose`` instead, on the same stretch of road, if it is free."""
        if self._is_free(pose):
            self.place(pose, self._before_m)
            self._before_m, self._before = self.odometer.metres, pose

    def wait(self) -> str:
        """One control step of a penalty has passed; only the time limit is judged."""
        self.step += 1
        self.pause_steps -= 1
        self.status = IN_PROGRESS if self.pause_steps <= 0 else PAUSE
        if self.step >= self._last_step:
            self._end(TIME_UP, TIME_UP)
        elif self.laps[-1].end_ms is not None:  # back at the start
            self._next_lap(milliseconds(self.step))
        return self.status

    def retire(self) -> None:
        """End the run of the car; its laps stand."""
        self._end(RETIRED, PARK)

    def judge(self, pose: Pose, rammed: bool = False) -> PutBack | None:
        """The car drove one control step to ``pose``: :meth:`move` and :meth:`verdict` in one."""
        self.move(pose)
        return self.verdict(rammed)

    def move(self, pose: Pose) -> None:
        """The car drove one control step to ``pose``. Where several cars drive, all move before any is judged."""
        self.step += 1
        odometer = self.odometer
        before_m = odometer.metres
        self._before_m, self._before = before_m, self.pose
        self.nose = nose = pose.ahead(self._nose_x)
        x, y = nose
        odometer.move(x, y)
        self.pose = pose
        older, newer = self.noses
        self.noses = (newer, nose)
        # one axis is enough for most movements
        if (abs(x - newer[0]) > SURELY_M or abs(y - newer[1]) > SURELY_M) and (
            abs(x - older[0]) > SURELY_M or abs(y - older[1]) > SURELY_M
        ):
            self._standing = 0
        else:
            stands = math.dist(nose, newer) <= STANDSTILL_M or math.dist(nose, older) <= STANDSTILL_M
            self._standing = self._standing + 1 if stands else 0
        metres = odometer.metres
        self.reversing = self.reversing + 1 if metres < before_m else 0
        if metres >= self.boxes.next_m:
            self.boxes.moved(metres)
        # the common case saves four exact tests
        distance, offset, _, _ = odometer.seen
        if -self._clear_m < offset < self._clear_m and self._clear_from < distance < self._clear_to:
            self._clear = self.all_wheels_on_track = True
        else:
            self._clear = False
            self._wheels_on = self.wheels(pose)
            self.all_wheels_on_track = all(self._wheels_on)

    def verdict(self, rammed: bool = False) -> PutBack | None:
        """Judge the step that :meth:`move` recorded; ``rammed``: the car ran into another from behind. Returns its new
        place after a fault: the caller then calls :meth:`place` with it and :meth:`wait` once a control step until
        ``pause_steps`` are over.

        Order of verdicts: time up, lap complete, crashed, off track, immobilised, reversed.
        """
        if self.step >= self._last_step:
            self._end(TIME_UP, TIME_UP)
            return None
        rammed |= self._owed
        self._owed = False
        lap = self.laps[-1]
        if lap.end_ms is not None:
            lap = self._next_lap(lap.end_ms)
        if self.odometer.metres >= self.line_m:
            self._cross_lines(self._before_m, self.odometer.metres)
        if lap.end_ms is not None:
            if lap.number == self.rules.laps:
                self._end(LAPS_DONE, LAP_COMPLETE)
                return None
            self.status = LAP_COMPLETE
            self._owed = rammed  # judged in the lap that begins: by then the two may be apart
            return self._back_to_start() if self.track.is_open or self.rules.standing_laps else None
        if self.boxes.hit(self.pose):
            return self._put_back(self.odometer.metres) if self._fault(CRASHED) else None
        if rammed:
            return PutBack(self.pose, self.odometer.metres) if self._fault(CRASHED) else None
        if not self._clear and (not any(self._wheels_on) or self.is_elsewhere(*self.odometer.seen[:2])):
            fault = OFF_TRACK
        elif self._standing >= PATIENCE_STEPS:
            fault = IMMOBILIZED
        elif self.reversing >= PATIENCE_STEPS:
            fault = REVERSED
        else:
            self.status = IN_PROGRESS
            return None
        if not self._fault(fault):
            return None
        # The base goes where the nose was; a car that only stands keeps its place.
        return self._put_back(self._before_m - (self._physics.nose_x if fault == IMMOBILIZED else 0.0))

    def _next_lap(self, start_ms: int) -> Lap:
        lap = Lap(self.laps[-1].number + 1, start_ms)
        self.laps.append(lap)
        self.line_m = self._next_line()
        return lap

    def _back_to_start(self) -> PutBack:
        """The next lap begins from rest at the start, a control step later, without a reset."""
        self.pause_steps = 1
        metres = self.lap_start_m + self.track.length
        start = PutBack(Pose(*self.track.point_at(self.start_m)), metres)
        if self.track.is_open or self._is_free(start.pose):
            return start
        return self._free_place(metres, INNER, metres + _SEARCH_M)

    def wheels(self, pose: Pose) -> list[bool]:
        """For each wheel whether its centre is on the road."""
        physics, on_road = self._physics, self.track.on_road
        return [
            on_road(*pose.ahead(axle, side))
            for axle in (physics.front_axle_x, physics.rear_axle_x)
            for side in (physics.half_track, -physics.half_track)
        ]

    def is_elsewhere(self, distance: float, offset: float) -> bool:
        """Whether every wheel is beyond the border of this part of the road. The wheels may be on another part of it
        alongside, where the original would let the car drive on."""
        left, right = self.track.half_widths_at(distance)
        return not -right - self._wheel_m <= offset <= left + self._wheel_m

    def _cross_lines(self, before_m: float, metres: float) -> None:
        """Record the sector and finish lines passed in this step, interpolated within it."""
        lap = self.lap
        while lap.end_ms is None and metres >= self.line_m:
            share = (self.line_m - before_m) / (metres - before_m) if metres > before_m else 1.0
            at_ms = milliseconds(self.step - 1 + min(max(share, 0.0), 1.0))
            lap.sector_ends_ms.append(at_ms)
            if len(lap.sector_ends_ms) == SECTORS:
                lap.end_ms = at_ms
            self.line_m = self._next_line()

    def _next_line(self) -> float:
        """Unwrapped distance of the end of the present sector."""
        return self.lap_start_m + self.track.length * (len(self.lap.sector_ends_ms) + 1) / SECTORS

    def _fault(self, status: str) -> bool:
        """Count a fault and use a reset; False where none is left."""
        self.status = status
        if status == CRASHED:
            self.crashes += 1
        counter = _FAULTS[status]
        setattr(self.lap, counter, getattr(self.lap, counter) + 1)
        if self.resets >= self.rules.max_resets:
            self._end(RESETS_USED, status)
            return False
        self.resets += 1
        self.lap.resets += 1
        self.pause_steps = max(1, self._penalties[status])
        return True

    def _put_back(self, metres: float) -> PutBack:
        """The centre of the lane nearer to the car one step ago, at ``metres`` but before the line. Boxes near by move
        it, see :meth:`paddock.simulator.boxes.BoxWatch.put_back`."""
        limit = self.lap_start_m + self.track.length - self._physics.nose_x - 0.01
        metres = max(min(metres, limit), self._least_m)
        places = [self._lane_centre(metres, lane) for lane in LANES]
        before = self._before
        lane = min(
            zip(places, LANES, strict=True), key=lambda at: math.hypot(at[0][0] - before.x, at[0][1] - before.y)
        )[1]
        metres, lane = self.boxes.put_back(metres, lane)
        return self._free_place(min(metres, limit), lane, limit)

    def _free_place(self, metres: float, lane: str, limit: float) -> PutBack:
        """The proper place or the nearest free one: in the other lane, then behind (but not before a passed box), then
        ahead (but not beyond a box or the line)."""
        proper = PutBack(Pose(*self._lane_centre(metres, lane)), metres)
        if self._is_free(proper.pose):
            return proper
        least = max(metres - _SEARCH_M, self.boxes.floor_m, self._least_m)
        most = min(metres + _SEARCH_M, limit, self.boxes.next_m - BEYOND_M)
        back = math.floor(max(0.0, metres - least) / _SEARCH_STEP_M)
        ahead = math.floor(max(0.0, most - metres) / _SEARCH_STEP_M)
        for shift in (*range(0, -back - 1, -1), *range(1, ahead + 1)):
            at = metres + shift * _SEARCH_STEP_M
            for side in (lane, other_lane(lane)):
                pose = Pose(*self._lane_centre(at, side))
                if self._is_free(pose):
                    return PutBack(pose, at)
        return proper

    @property
    def _least_m(self) -> float:
        """The least place for a car: an open track has nothing before its start."""
        return self.lap_start_m if self.track.is_open else -math.inf

    def _lane_centre(self, metres: float, lane: str) -> tuple[float, float, float]:
        return self.track.lane_centre(self.track.along(metres), lane)

    def _is_free(self, pose: Pose) -> bool:
        return self.boxes.free(pose) and self._free(pose)

    def _start(self, start_m: float, grid: int | None) -> PutBack:
        """The start of the car. On a grid: ``duel_gap_m`` behind the car before, odd ones in the inner lane
        (deepracer-simapp, START_POS_OFFSET)."""
        if grid is not None:
            metres = start_m - self.rules.duel_gap_m * grid
            return PutBack(Pose(*self.track.lane_centre(metres, INNER if grid % 2 else OUTER)), metres)
        centre = PutBack(Pose(*self.track.point_at(start_m)), start_m)
        if self._is_free(centre.pose):
            return centre
        limit = self.track.length - self._physics.nose_x - 0.01 if self.track.is_open else math.inf
        return self._free_place(start_m, INNER, min(start_m + _SEARCH_M, limit))

    def _end(self, reason: str, status: str) -> None:
        self.end_reason = reason
        self.status = status
