"""One car in a race: the body, its sensors, its referee and its trace, moved on together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .action import Action
from .car import Car, Pose
from .referee import PutBack, Referee
from .sensors import Reading
from .solids import Solid
from .states import rows_of, trace_of
from .trace import LAP_COMPLETE, PREPARE, Row, Trace

_NO_ACTION = Action(0.0, 0.0, None)


class Competitor:
    """A car with everything that belongs to it. The stage moves the world between :meth:`command` and :meth:`judge`."""

    def __init__(
        self,
        car: Car,
        referee: Referee,
        sensors: dict[str, Reading],
        solids: Callable[[Competitor], Sequence[Solid]],
    ) -> None:
        """``solids``: what stands and drives on the track besides a competitor."""
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
        """True when its run is over."""
        return self.referee.end_reason is not None

    @property
    def pausing(self) -> bool:
        """True while it stands out a penalty; other cars then pass through it."""
        return self.referee.pause_steps > 0

    @property
    def stands_at(self) -> Pose:
        """Where it is, or where it is about to be put."""
        return self.referee.pose if self._put_back is None else self._put_back.pose

    def begin_at(self, pose: Pose) -> None:
        """Before the first step: begin the run at ``pose`` instead, unless something stands there."""
        self.referee.begin_at(pose)
        self.car.place(self.referee.pose)

    def observe(self, places: dict[str, np.ndarray] | None = None) -> dict[str, np.ndarray]:
        """A reading of each sensor, in sorted order of their names; fresh arrays. Or ``places``, one for each sensor,
        which hold them now."""
        car, solids = self.car, self._solids(self)
        if places is None:
            return {name: read(car, solids) for name, read in self._sensors.items()}
        for name, read in self._sensors.items():
            read(car, solids, places[name])
        return places

    def command(self, action: Action) -> None:
        """Write down the state and the action, and give the command to the car."""
        self.note(action)
        self.car.command(action.steering_deg, action.speed_mps)

    def note(self, action: Action) -> None:
        """Write down the state and the action."""
        self.action = action
        self._record()

    def cruised(self, action: Action, lap_steps: int, states: np.ndarray) -> None:
        """The car drove on, as :mod:`.cruise` wrote it down; ``action`` was the last."""
        self.action, self.lap_steps = action, lap_steps
        self._states.append(states)

    def stand(self) -> None:
        """In place of a command while it stands out a penalty: write down the state, put the car back if it is due."""
        self.action = _NO_ACTION
        self._record()
        if self._put_back is not None:
            self.car.place(self._put_back.pose)
            self.referee.place(*self._put_back)
            self._put_back = None

    def move(self) -> None:
        """A control step has passed: see where the car is now. All cars do so before any is judged."""
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
        """End the run here; what was driven stands."""
        self.referee.retire()
        self.status = self.referee.status
        self.action = _NO_ACTION
        self._record()

    def _record(self) -> None:
        """Write down the present state, see :class:`.states.StepState`."""
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
        """All rows of the trace so far."""
        return rows_of(self.trace())

    def trace(self) -> Trace:
        """The trace so far."""
        return trace_of(self._states, self.referee.track, self.referee.start_m)
