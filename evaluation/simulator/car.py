"""The car: a Bullet multibody of chassis, two steering hinges and four wheels, driven by joint motors."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import pybullet as bullet

from .physics import CarPhysics

# Collision groups. Bullet puts static bodies in group 2, and the ground plane's own mask lets group 4 in: a car in
# another group falls through the ground in silence.
GROUND_GROUP = 2
CAR_GROUP = 4

# Links in Bullet's order: depth first, a hinge before its wheel.
REAR_LEFT, REAR_RIGHT, HINGE_LEFT, FRONT_LEFT, HINGE_RIGHT, FRONT_RIGHT = range(6)
WHEELS = (REAR_LEFT, REAR_RIGHT, FRONT_LEFT, FRONT_RIGHT)
HINGES = (HINGE_LEFT, HINGE_RIGHT)
_UNTURNED = (0.0, 0.0, 0.0, 1.0)


class Pose(NamedTuple):
    """Where the base of a car is: metres and radians, yaw in (-pi, pi]."""

    x: float
    y: float
    yaw: float

    def ahead(self, forward: float, left: float = 0.0) -> tuple[float, float]:
        """The point ``forward`` metres before and ``left`` metres beside the base."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + forward * cos - left * sin, self.y + forward * sin + left * cos


class Car:
    """One car in a Bullet world. Made by :meth:`evaluation.simulator.world.World.add_car`."""

    def __init__(self, client: int, physics: CarPhysics) -> None:
        self.physics = physics
        self._client = client
        self.body = _build(client, physics)
        self._steering_gain = physics.gain(physics.steering_lag_s)
        self._speed_gain = physics.gain(physics.speed_lag_s)
        # Share of a change in steering that has happened, on average, over the control step in which it arrives.
        self._mean_response = _mean_response(physics)
        self._applied: tuple[float, float] | None = None
        self._waiting: deque[tuple[float, float]] = deque()
        self._wheel_angle = 0.0
        self._pose: Pose | None = None
        self.place(Pose(0.0, 0.0, 0.0))

    @property
    def pose(self) -> Pose:
        """Where the base is now; asked of Bullet once, until the world moves."""
        if self._pose is None:
            (x, y, _), (qx, qy, qz, qw) = bullet.getBasePositionAndOrientation(self.body, self._client)
            self._pose = Pose(x, y, math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz)))
        return self._pose

    @property
    def height(self) -> float:
        """Metres of the axles above the ground; the wheels' radius while the car stands on it."""
        lift = self.physics.wheel_radius - self.physics.mass_height
        return bullet.getBasePositionAndOrientation(self.body, self._client)[0][2] + lift

    @property
    def speed(self) -> float:
        """Metres a second over the ground."""
        (vx, vy, _), _ = bullet.getBaseVelocity(self.body, self._client)
        return math.hypot(vx, vy)

    def place(self, pose: Pose) -> None:
        """Put the car there, standing still, wheels straight, nothing commanded."""
        self.start(pose, speed=0.0, wheel_angle=0.0)

    def start(self, pose: Pose, *, speed: float, wheel_angle: float, yaw_rate: float = 0.0) -> None:
        """Put the car there rolling at ``speed`` m/s with the front wheels at ``wheel_angle`` rad."""
        half = pose.yaw / 2.0
        turned = (0.0, 0.0, math.sin(half), math.cos(half))
        bullet.resetBasePositionAndOrientation(
            self.body, (pose.x, pose.y, self.physics.mass_height), turned, self._client
        )
        velocity = (speed * math.cos(pose.yaw), speed * math.sin(pose.yaw), 0.0)
        bullet.resetBaseVelocity(self.body, velocity, (0.0, 0.0, yaw_rate), self._client)
        for joint in WHEELS:
            bullet.resetJointState(self.body, joint, 0.0, speed / self.physics.wheel_radius, self._client)
        for joint in HINGES:
            bullet.resetJointState(self.body, joint, wheel_angle, 0.0, self._client)
        self._wheel_angle = wheel_angle
        self._pose = None
        self._waiting.clear()
        self._applied = None
        self._drive(wheel_angle, wheel_angle, speed)

    def moved(self) -> None:
        """The world has moved: what was read of the car is out of date."""
        self._pose = None

    def command(self, steering_deg: float, speed: float) -> None:
        """Take a command; :meth:`apply` brings it to the motors when the dead time is over."""
        limit = self.physics.max_steering_deg
        steering_deg = min(max(steering_deg, -limit), limit)
        speed = min(max(speed, self.physics.min_speed), self.physics.max_speed)
        self._waiting.append((steering_deg, speed))

    def apply(self, steps_late: int) -> None:
        """Drive the motors by the command that is ``steps_late`` control steps old; called once a control step."""
        while len(self._waiting) > steps_late + 1:
            self._waiting.popleft()
        if len(self._waiting) <= steps_late:
            return
        steering_deg, speed = self._waiting.popleft()
        physics = self.physics
        target = physics.wheel_angle(steering_deg)
        mean = self._wheel_angle + (target - self._wheel_angle) * self._mean_response
        self._wheel_angle += (target - self._wheel_angle) * (
            1.0 - (1.0 - self._steering_gain) ** physics.ticks_per_step
        )
        self._drive(target, mean, speed * physics.speed_gain)

    def _drive(self, target: float, mean: float, speed: float) -> None:
        """Set motor targets: hinges by Ackermann for ``target``, wheels by an electronic differential for ``mean``."""
        if self._applied == (target, mean, speed):
            return  # motor targets persist
        self._applied = (target, mean, speed)
        physics = self.physics
        body, client = self.body, self._client
        curvature = math.tan(target) / physics.wheelbase
        for joint, side in ((HINGE_LEFT, physics.half_track), (HINGE_RIGHT, -physics.half_track)):
            bullet.setJointMotorControl2(
                body,
                joint,
                bullet.POSITION_CONTROL,
                targetPosition=math.atan(physics.wheelbase * curvature / (1.0 - side * curvature)),
                force=physics.steering_torque,
                positionGain=self._steering_gain,
                velocityGain=1.0,
                physicsClientId=client,
            )
        curvature = math.tan(mean) / physics.wheelbase
        spin = speed / physics.wheel_radius
        left, right = 1.0 - physics.half_track * curvature, 1.0 + physics.half_track * curvature
        rise = physics.wheelbase * curvature
        bullet.setJointMotorControlArray(
            body,
            WHEELS,
            bullet.VELOCITY_CONTROL,
            targetVelocities=(
                spin * left,
                spin * right,
                spin * math.hypot(left, rise),
                spin * math.hypot(right, rise),
            ),
            forces=(physics.wheel_torque,) * 4,
            velocityGains=(self._speed_gain,) * 4,
            physicsClientId=client,
        )


def _mean_response(physics: CarPhysics) -> float:
    keep = 1.0 - physics.gain(physics.steering_lag_s)
    ticks = physics.ticks_per_step
    return sum(1.0 - keep**tick for tick in range(1, ticks + 1)) / ticks


def _build(client: int, physics: CarPhysics) -> int:
    """Create the multibody. The inertias are ours: Bullet would otherwise guess them from the collision shapes."""
    # Spheres: cylinders rattle and pull the car sideways at any rate.
    sphere = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=physics.wheel_radius, physicsClientId=client)
    rear, front, side = physics.rear_axle_x, physics.front_axle_x, physics.half_track
    axles = [
        (rear, side, 0.0),
        (rear, -side, 0.0),
        (front, side, 0.0),
        (0.0, 0.0, 0.0),
        (front, -side, 0.0),
        (0.0, 0.0, 0.0),
    ]
    masses = {**dict.fromkeys(WHEELS, physics.wheel_mass), **dict.fromkeys(HINGES, physics.hinge_mass)}
    links = range(len(axles))
    body = bullet.createMultiBody(
        baseMass=physics.chassis_mass,
        basePosition=(0.0, 0.0, physics.wheel_radius),
        baseInertialFramePosition=(0.0, 0.0, physics.mass_height - physics.wheel_radius),
        linkMasses=[masses[link] for link in links],
        linkCollisionShapeIndices=[sphere if link in WHEELS else -1 for link in links],
        linkVisualShapeIndices=[-1 for _ in links],
        linkPositions=axles,
        linkOrientations=[_UNTURNED for _ in links],
        linkInertialFramePositions=[(0.0, 0.0, 0.0) for _ in links],
        linkInertialFrameOrientations=[_UNTURNED for _ in links],
        # Parents count from 1; 0 is the chassis.
        linkParentIndices=[0, 0, 0, HINGE_LEFT + 1, 0, HINGE_RIGHT + 1],
        linkJointTypes=[bullet.JOINT_REVOLUTE for _ in links],
        linkJointAxis=[(0.0, 0.0, 1.0) if link in HINGES else (0.0, 1.0, 0.0) for link in links],
        physicsClientId=client,
    )
    # One kind of change a call: one that also sets damping or the joint speed goes to the chassis, whatever its link.
    bullet.changeDynamics(body, -1, localInertiaDiagonal=physics.chassis_inertia, physicsClientId=client)
    bullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=client)
    bullet.changeDynamics(body, -1, maxJointVelocity=physics.max_joint_velocity, physicsClientId=client)
    for link in (-1, *links):
        bullet.setCollisionFilterGroupMask(body, link, CAR_GROUP, GROUND_GROUP, client)
    for link in links:
        wheel = link in WHEELS
        inertia = physics.wheel_inertia if wheel else (physics.hinge_inertia,) * 3
        bullet.changeDynamics(body, link, localInertiaDiagonal=inertia, physicsClientId=client)
        if wheel:
            bullet.changeDynamics(
                body,
                link,
                lateralFriction=physics.friction,
                spinningFriction=0.0,
                rollingFriction=0.0,
                restitution=0.0,
                physicsClientId=client,
            )
    return body
