"""Every number of the car's physics, in one frozen, named and versioned set."""

# Raise the set's ``version`` with every change, and ``ENGINE_ID`` (:mod:`.engine`) once results are published.

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class CarPhysics:
    """One car. Lengths in metres, masses in kg, times in seconds, angles in degrees if the name ends so.

    Geometry and masses: deepracer-simapp, urdf/deepracer (macros.xacro, racecar.xacro). Response: fitted on recorded
    drives of the official simulator (15 Hz sim-traces).
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
    # Spin axis is y, five times the bare wheel's 0.00041226 for its motor: else the car needs twice the iterations.
    wheel_inertia: tuple[float, float, float] = (0.00026046, 0.0020613, 0.00026046)
    hinge_inertia: float = 0.0001
    chassis_inertia: tuple[float, float, float] = (0.0195, 0.0543, 0.0690)  # a box of 0.324 x 0.188 x 0.06 m

    # Commands: agent_ctrl/constants.py.
    max_steering_deg: float = 30.0
    min_speed: float = 0.1
    max_speed: float = 4.0

    # Response: fitted on the recorded drives (docs/simulator.md, "The car against recorded drives").
    effective_wheelbase: float = 0.285  # m; a steering angle a demands the curvature tan(a) / this
    curvature_limit: float = 1.82  # 1/m, standing
    curvature_limit_falloff: float = 0.11  # (s/m)^2; the limit at speed v is curvature_limit / (1 + this * v^2)
    curvature_limit_sharpness: float = 3.2  # the greater, the more abruptly the limit cuts in
    steering_lag_s_per_mps: float = 0.068  # lag of the demanded curvature: seconds for each m/s of speed
    steering_dead_ticks: int = 3  # ticks between a command and the first movement of the steering
    speed_rise_s: float = 0.01
    speed_fall_s: float = 0.07
    speed_dead_ticks: int = 3
    acceleration: float = 6.8  # m/s^2, at most
    braking: float = 13.0  # m/s^2, at most
    speed_gain: float = 1.029  # simapp divides by a wheel radius of 0.035 m, and the wheel has 0.036 m

    # Tyres and motors: strong enough that the body follows the response above without sliding.
    friction: float = 4.0  # wheel x ground; Bullet multiplies the two
    wheel_torque: float = 2.5  # N m, each wheel
    motor_gain: float = 0.1  # share of the difference that a motor removes in a move: a step is nearly a ramp
    steering_torque: float = 10.0  # N m; joint effort limit of macros.xacro
    max_joint_velocity: float = 1000.0  # rad/s; Bullet's default of 100 caps the car at 3.6 m/s
    mass_height: float = 0.008  # m above the ground, chassis; higher lifts the front axle under full torque

    # World.
    gravity: float = 9.81
    tick_hz: int = 120  # the response's clock
    ticks_per_step: int = 8  # control at 15 Hz, the rate of the official camera
    ticks_per_move: int = 2  # Bullet moves the bodies at 60 Hz; at 30 Hz wheels leave the ground
    solver_iterations: int = 11  # with 10 the car pulls to a side by twice as much

    @property
    def wheelbase(self) -> float:
        """Metres between the axles."""
        return self.front_axle_x - self.rear_axle_x

    @property
    def control_hz(self) -> float:
        """Control steps in a second."""
        return self.tick_hz / self.ticks_per_step

    def moves(self, ticks: int) -> int:
        """The number of Bullet's moves in so many ticks, each of at most ``ticks_per_move``."""
        return -(-ticks // self.ticks_per_move)

    def curvature(self, demand: float, speed: float) -> float:
        """The driven curvature (1/m) for a demanded one at ``speed`` m/s, cut off smoothly by the grip."""
        limit = self.curvature_limit / (1.0 + self.curvature_limit_falloff * speed * speed)
        sharpness = self.curvature_limit_sharpness
        return demand / (1.0 + (abs(demand) / limit) ** sharpness) ** (1.0 / sharpness)

    def demand(self, curvature: float, speed: float) -> float:
        """The inverse of :meth:`curvature`, up to nearly the limit."""
        limit = self.curvature_limit / (1.0 + self.curvature_limit_falloff * speed * speed)
        sharpness = self.curvature_limit_sharpness
        share = min(abs(curvature) / limit, 0.95)
        return math.copysign(share * limit / (1.0 - share**sharpness) ** (1.0 / sharpness), curvature)

    def gain(self, lag_s: float) -> float:
        """Share of the remaining error that a first-order lag of ``lag_s`` removes in one tick."""
        return 1.0 if lag_s <= 0 else 1.0 - math.exp(-1.0 / (self.tick_hz * lag_s))


PADDOCK_CAR = CarPhysics(name="paddock-car", version=3)
STEP_MS = 1000.0 * PADDOCK_CAR.ticks_per_step / PADDOCK_CAR.tick_hz


def milliseconds(steps: float) -> int:
    """Whole milliseconds after ``steps`` control steps, rounded."""
    return round(steps * STEP_MS)
