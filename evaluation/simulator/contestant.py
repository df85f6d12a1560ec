"""One car in a race: the body, its sensors, its referee and its trace, moved on together."""

from __future__ import annotations

import math

import numpy as np

from tracks.geometry import TrackGeometry

from .action import Action
from .car import Car
from .clock import STEP_MS
from .referee import PutBack, Referee
from .sensors import Reading
from .trace import LAP_COMPLETE, PAUSE, PREPARE, Row, Trace

_NO_ACTION = Action(0.0, 0.0, None)


class Contestant:
    """A car with everything that belongs to it. The stage moves the world between :meth:`command` and :meth:`judge`."""

    def __init__(self, car: Car, referee: Referee, sensors: dict[str, Reading]) -> None:
        self.car = car
        self.referee = referee
        self._sensors = sensors
        self.rows: list[Row] = []
        self.status = PREPARE
        self.lap_steps = 1  # of the row to come, counted from 1 in each lap
        self.action = _NO_ACTION
        self.reward = 0.0  # written into the next row; a race has no reward function
        self._put_back: PutBack | None = None
        car.place(referee.pose)

    @property
    def done(self) -> bool:
        """True when its run is over."""
        return self.referee.done

    @property
    def pausing(self) -> bool:
        """True while it stands out a penalty; other cars then pass through it."""
        return self.referee.pause_steps > 0

    def observe(self) -> dict[str, np.ndarray]:
        """A reading of each sensor, in sorted order of their names; fresh arrays."""
        return {name: read(self.car) for name, read in self._sensors.items()}

    def command(self, action: Action) -> None:
        """Write down the state and the action, and give the command to the car."""
        self.action = action
        self._record()
        self.car.command(action.steering_deg, action.speed_mps)

    def stand(self) -> None:
        """In place of a command while it stands out a penalty: write down the state, put the car back if it is due."""
        self.action = _NO_ACTION
        self._record()
        if self._put_back is not None:
            self.car.place(self._put_back.pose)
            self.referee.place(*self._put_back)
            self._put_back = None

    def judge(self) -> None:
        """A control step has passed: judge it."""
        referee = self.referee
        if self.status == LAP_COMPLETE:
            self.lap_steps = 0
        self.lap_steps += 1
        if self.pausing:
            self.status = referee.wait()
        else:
            self._put_back = referee.judge(self.car.pose)
            self.status = referee.status
        if self.done:
            self._record()

    def _record(self) -> None:
        """Append the row of the present state."""
        referee = self.referee
        track = referee.track
        place = referee.odometer.place
        pose = referee.pose
        x, y = pose.ahead(self.car.physics.nose_x)
        seconds = referee.step * STEP_MS / 1000.0
        self.rows.append(
            Row(
                episode=referee.lap.number - 1,
                steps=float(self.lap_steps),
                X=x,
                Y=y,
                yaw=math.degrees(pose.yaw),
                steer=self.action.steering_deg,
                throttle=self.action.speed_mps,
                action=-1 if self.action.index is None else self.action.index,
                reward=self.reward,
                done=self.status == LAP_COMPLETE or self.done,
                all_wheels_on_track=referee.all_wheels_on_track,
                progress=referee.percent,
                closest_waypoint=closest_waypoint(track, place.distance, place.index),
                track_len=track.length,
                tstamp=seconds,
                episode_status=self.status,
                pause_duration=referee.pause_steps * STEP_MS / 1000.0 if self.status == PAUSE else 0.0,
                obstacle_crash_counter=0,
                wall_clock=seconds,
            )
        )

    def trace(self) -> Trace:
        """All rows so far."""
        return Trace.of(self.rows)


def closest_waypoint(track: TrackGeometry, distance: float, index: int) -> int:
    """The nearer end of segment ``index`` for a point at ``distance``."""
    after = index + 1 if index + 1 < len(track) else 0
    end = float(track.cumulative[after]) if after else track.length
    return after if end - distance < distance - float(track.cumulative[index]) else index
