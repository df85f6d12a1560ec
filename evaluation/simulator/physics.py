"""Every number of the car's physics, in one frozen, named, versioned set. Change a figure and you change lap times:
raise ``ENGINE_ID`` in :mod:`evaluation.simulator.engine` with it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class CarPhysics:
    """One car. Lengths in metres, masses in kg, times in seconds, angles in degrees where the name says so.

    Geometry and masses: deepracer-simapp, urdf/deepracer (macros.xacro, racecar.xacro). Response: fitted on recorded
    drives of the official simulator (15 Hz sim-traces), where the car follows its commands almost kinematically.
    """

    name: str
    version: int

    # Geometry: deepracer-simapp macros.xacro. x is forward from the base, which lies between the axles.
    rear_axle_x: float = -0.081663
    front_axle_x: float = 0.082311
    half_track: float = 0.08  # rear 0.1621 m, front 0.159202 m between wheel centres; one figure for both
    wheel_radius: float = 0.036
    nose_x: float = 0.14  # agent_ctrl/constants.py, RELATIVE_POSITION_OF_FRONT_OF_CAR
    body_length: float = 0.324
    body_width: float = 0.188

    # Masses: macros.xacro; chassis 5.0 + body 0.3 + two camera parts of 0.34055.
    chassis_mass: float = 5.98
    wheel_mass: float = 0.34055
    hinge_mass: float = 0.1
    wheel_inertia: tuple[float, float, float] = (0.00026046, 0.00041226, 0.00026046)  # spin axis is y
    hinge_inertia: float = 0.0001
    chassis_inertia: tuple[float, float, float] = (0.0195, 0.0543, 0.0690)  # a box of 0.324 x 0.188 x 0.06 m

    # Commands: agent_ctrl/constants.py.
    max_steering_deg: float = 30.0
    min_speed: float = 0.1
    max_speed: float = 4.0

    # Response: fitted on the recorded drives (see the class): 0.12-0.17 m and 7-9 degrees off after 1 s, median.
    effective_wheelbase: float = 0.262  # m; steady curvature is tan(a) / (this + understeer * |tan(a)|) for steering a
    understeer: float = 0.118  # m
    steering_lag_s: float = 0.094
    speed_lag_s: float = 0.048
    dead_time_ticks: int = 5  # physics ticks between a command and the first movement of a motor (0.04 s)
    speed_gain: float = 1.008

    # Tyres and motors: the recorded cars change speed by up to 33 m/s^2 and corner at up to 6.8 m/s^2 without a slide
    # (their plugin is almost kinematic), so grip and torque are above, and the centre of mass below, those of a toy.
    friction: float = 4.0  # wheel x ground; Bullet multiplies the two
    wheel_torque: float = 1.5  # N m, each wheel: about 22 m/s^2; more makes the wheels slip and pull to a side
    steering_torque: float = 10.0  # N m; joint effort limit of macros.xacro
    max_joint_velocity: float = 1000.0  # rad/s; Bullet's default of 100 caps the car at 3.6 m/s in silence
    mass_height: float = 0.008  # m above the ground, chassis; a higher one lifts the front axle under full torque

    # World.
    gravity: float = 9.81
    tick_hz: int = 120
    ticks_per_step: int = 8  # control at 15 Hz, the rate of the official camera
    solver_iterations: int = 20

    @property
    def wheelbase(self) -> float:
        """Metres between the axles."""
        return self.front_axle_x - self.rear_axle_x

    @property
    def control_hz(self) -> float:
        """Control steps in a second."""
        return self.tick_hz / self.ticks_per_step

    def wheel_angle(self, steering_deg: float) -> float:
        """Angle (rad) of a front wheel in the middle that gives the steady curvature of a steering command."""
        tangent = math.tan(math.radians(steering_deg))
        return math.atan(tangent * self.wheelbase / (self.effective_wheelbase + self.understeer * abs(tangent)))

    def gain(self, lag_s: float) -> float:
        """Share of the remaining error that a first-order lag of ``lag_s`` removes in one physics tick."""
        return 1.0 if lag_s <= 0 else 1.0 - math.exp(-1.0 / (self.tick_hz * lag_s))


PADDOCK_CAR = CarPhysics(name="paddock-car", version=1)
