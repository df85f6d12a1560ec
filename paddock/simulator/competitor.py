"""One car in a race: body, sensors, referee and trace, advanced together."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from .action import Action
from .car import Car, Pose
from .referee import PutBack, Referee
from .results import Lap, LapResult
from .sensors import CameraReading, Reading
from .solids import Solid
from .trace import LABELS, LAP_COMPLETE, PREPARE, Row, Trace, rows_of, trace_of

_NO_ACTION = Action(0.0, 0.0, None)


class Competitor:
    """A car with its referee, sensors and trace. The stage moves the world between :meth:`command` and
    :meth:`judge`."""

    def __init__(
        self,
        car: Car,
        referee: Referee,
        sensors: dict[str, Reading],
        solids: Callable[[Competitor], Sequence[Solid]],
    ) -> None:
        """``solids``: the blocks on the track besides a competitor."""
        self.car = car
        self.referee = referee
        self._sensors = sensors
        self._solids = solids
        self._states: list[tuple | np.ndarray] = []
        self.status = PREPARE
        self.lap_steps = 1  # of the row to come, counted from 1 in each lap
        self.action = _NO_ACTION
        self.reward = 0.0  # written into the next row; a race has no reward function
        self._put_back: PutBack | None = None
        car.place(referee.pose)

    @property
    def done(self) -> bool:
        return self.referee.end_reason is not None

    @property
    def pausing(self) -> bool:
        """Whether it serves a penalty; other cars then pass through it."""
        return self.referee.pause_steps > 0

    @property
    def stands_at(self) -> Pose:
        """Its pose, or the pose of a reset that is due."""
        return self.referee.pose if self._put_back is None else self._put_back.pose

    def begin_at(self, pose: Pose) -> None:
        """Begin the run at ``pose`` instead, unless something stands there."""
        self.referee.begin_at(pose)
        self.car.place(self.referee.pose)

    def observe(self, places: dict[str, np.ndarray] | None = None) -> dict[str, np.ndarray]:
        """A reading of each sensor, sorted by name: fresh arrays, or ``places`` filled with them."""
        car, solids = self.car, self._solids(self)
        if places is None:
            return {name: read(car, solids) for name, read in self._sensors.items()}
        for name, read in self._sensors.items():
            read(car, solids, places[name])
        return places

    def drawing_in(self, places: dict[str, np.ndarray] | None) -> tuple[int, int] | None:
        """For a car with one camera alone, see :meth:`.camera.view.Camera.drawing_in`."""
        for name, read in self._sensors.items():
            if len(self._sensors) == 1 and places is not None and isinstance(read, CameraReading):
                return read.camera.drawing_in(places[name])
        return None

    def command(self, action: Action) -> None:
        """Record the state and the action, and give the command to the car."""
        self.note(action)
        self.car.command(action.steering_deg, action.speed_mps)

    def note(self, action: Action) -> None:
        self.action = action
        self._record()

    def cruised(self, action: Action, lap_steps: int, states: np.ndarray) -> None:
        """The car drove on, as :mod:`.cruise` recorded; ``action`` was the last."""
        self.action, self.lap_steps = action, lap_steps
        self._states.append(states)

    def stand(self) -> None:
        """In place of a command during a penalty: record the state, and reset the car if it is due."""
        self.action = _NO_ACTION
        self._record()
        if self._put_back is not None:
            self.car.place(self._put_back.pose)
            self.referee.place(*self._put_back)
            self._put_back = None

    def move(self) -> None:
        """Follow the car after a control step. All cars do so before any is judged."""
        referee = self.referee
        if referee.pause_steps <= 0:
            referee.move(self.car.pose)

    def judge(self, rammed: bool = False) -> None:
        """Judge the control step; ``rammed``: the car ran into another from behind."""
        referee = self.referee
        if self.status == LAP_COMPLETE:
            self.lap_steps = 0
        self.lap_steps += 1
        if referee.pause_steps > 0:
            self.status = referee.wait()
        else:
            self._put_back = referee.verdict(rammed)
            self.status = referee.status
        if referee.end_reason is not None:
            self._record()

    def retire(self) -> None:
        """End the run here; its laps stand."""
        self.referee.retire()
        self.status = self.referee.status
        self.action = _NO_ACTION
        self._record()

    def _record(self) -> None:
        """Record the present state, see :class:`.trace.StepState`."""
        referee, status = self.referee, self.status
        steering_deg, speed_mps, index = self.action
        odometer = referee.odometer
        distance, _, _, segment = odometer.place
        x, y = referee.nose
        lap = referee.laps[-1]
        self._states.append(
            (
                lap.number,
                self.lap_steps,
                x,
                y,
                referee.pose[2],
                steering_deg,
                speed_mps,
                -1 if index is None else index,
                self.reward,
                status == LAP_COMPLETE or referee.end_reason is not None,
                referee.all_wheels_on_track,
                odometer.metres,
                lap.end_ms is not None,
                distance,
                segment,
                referee.step,
                status,
                referee.pause_steps,
                referee.crashes,
            )
        )

    @property
    def rows(self) -> list[Row]:
        return rows_of(self.trace())

    def trace(self) -> Trace:
        return trace_of(self._states, self.referee.track, self.referee.start_m)

    def lap_results(self) -> list[LapResult]:
        """The laps driven so far, the unfinished one last."""
        return [self._lap_result(lap) for lap in self.referee.laps]

    def _lap_result(self, lap: Lap) -> LapResult:
        complete = lap.end_ms is not None
        end_ms = lap.end_ms if lap.end_ms is not None else self.referee.time_ms
        starts = [lap.start_ms, *lap.sector_ends_ms]
        return LapResult(
            number=lap.number,
            start_ms=lap.start_ms,
            time_ms=end_ms - lap.start_ms,
            complete=complete,
            off_tracks=lap.off_tracks,
            crashes=lap.crashes,
            resets=lap.resets,
            immobilised=lap.immobilised,
            reversals=lap.reversals,
            sector_ms=[after - before for before, after in zip(starts, lap.sector_ends_ms, strict=False)],
            completion_percentage=100 if complete else max(0, math.floor(self.referee.percent)),
            status=LABELS["lap_complete" if complete else self.status],
        )
