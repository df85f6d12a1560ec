"""The response of a car to its commands: motor targets for speed and steering, tick by tick."""

from __future__ import annotations

import copy
import math
from collections import deque

from .physics import CarPhysics


class Response:
    """The drive train and the steering between a command and the motors, without Bullet.

    A command waits for its dead time, one for steering and one for speed. The speed then follows with one lag for
    rising and one for falling, within the car's acceleration and braking; the demanded curvature follows with a lag
    too, cut off smoothly by the grip (:meth:`~paddock.simulator.physics.CarPhysics.curvature`).
    """

    def __init__(self, physics: CarPhysics, speed: float = 0.0, demand: float = 0.0) -> None:
        self.physics = physics
        self.speed = speed  # m/s, of the middle of the rear axle
        self.demand = demand  # 1/m, positive to the left
        self._wanted_speed = speed
        self._wanted_demand = demand
        self._tick = 0
        self._steering: deque[tuple[int, float]] = deque()  # (tick at which it begins to act, demand)
        self._speeds: deque[tuple[int, float]] = deque()
        self._step_speed_up = physics.acceleration / physics.tick_hz
        self._step_speed_down = physics.braking / physics.tick_hz
        self._rise = physics.gain(physics.speed_rise_s)
        self._fall = physics.gain(physics.speed_fall_s)
        self._commanded = (  # for command(), in one piece
            *(physics.max_steering_deg, physics.min_speed, physics.max_speed, physics.effective_wheelbase),
            *(physics.steering_dead_ticks, physics.speed_dead_ticks, physics.speed_gain),
        )
        self._lag_ticks_per_mps = physics.steering_lag_s_per_mps * physics.tick_hz

    @property
    def curvature(self) -> float:
        """1/m, of the path of the rear axle now."""
        return self.physics.curvature(self.demand, self.speed)

    def copy(self) -> Response:
        twin = copy.copy(self)
        twin._steering = deque(self._steering)
        twin._speeds = deque(self._speeds)
        return twin

    def command(self, steering_deg: float, speed: float) -> None:
        """Take a command (degrees to the left, m/s), clipped to the limits of the car."""
        limit, least, most, wheelbase, steering_dead, speed_dead, gain = self._commanded
        tick = self._tick
        if steering_deg > limit:
            steering_deg = limit
        elif steering_deg < -limit:
            steering_deg = -limit
        if speed < least:
            speed = least
        elif speed > most:
            speed = most
        demand = math.tan(math.radians(steering_deg)) / wheelbase
        self._steering.append((tick + steering_dead, demand))
        self._speeds.append((tick + speed_dead, speed * gain))

    def advance(self, ticks: int) -> None:
        """Advance by ``ticks`` (1/120 s)."""
        speed, wanted_speed = self.speed, self._wanted_speed
        demand, wanted = self.demand, self._wanted_demand
        steering, speeds = self._steering, self._speeds
        lag_per_mps = self._lag_ticks_per_mps
        rise, fall, most_up, most_down = self._rise, self._fall, self._step_speed_up, self._step_speed_down
        tick, end = self._tick, self._tick + ticks
        while tick < end:
            while steering and steering[0][0] <= tick:
                wanted = steering.popleft()[1]
            while speeds and speeds[0][0] <= tick:
                wanted_speed = speeds.popleft()[1]
            until = end  # no command begins to act before
            if steering and steering[0][0] < until:
                until = steering[0][0]
            if speeds and speeds[0][0] < until:
                until = speeds[0][0]
            for _ in range(until - tick):
                if wanted_speed > speed:
                    change = rise * (wanted_speed - speed)
                    speed += change if change < most_up else most_up
                else:
                    change = fall * (speed - wanted_speed)
                    speed -= change if change < most_down else most_down
                # One tick of a first-order lag, solved backwards: stable however short the lag.
                demand += (wanted - demand) / (1.0 + lag_per_mps * speed)
            tick = until
        self._tick = end
        self.speed, self._wanted_speed = speed, wanted_speed
        self.demand, self._wanted_demand = demand, wanted
