"""The car: a Bullet multibody of chassis, two steering hinges and four wheels, driven by joint motors."""

import math
from typing import NamedTuple

import pybullet as bullet

from .physics import CarPhysics
from .response import Response

# Collision groups. Bullet puts static bodies in group 2, and the ground plane's mask admits group 4.
GROUND_GROUP = 2
CAR_GROUP = 4

# Links in Bullet's order: depth first, a hinge before its wheel.
REAR_LEFT, REAR_RIGHT, HINGE_LEFT, FRONT_LEFT, HINGE_RIGHT, FRONT_RIGHT = range(6)
WHEELS = (REAR_LEFT, REAR_RIGHT, FRONT_LEFT, FRONT_RIGHT)
HINGES = (HINGE_LEFT, HINGE_RIGHT)
_JOINTS = tuple(range(len(WHEELS) + len(HINGES)))
MAX_STRIDE = 32  # the most ticks for which motors are set at once
_UNTURNED = (0.0, 0.0, 0.0, 1.0)


_made = tuple.__new__  # of a class and its values, without a call through Python


class Pose(NamedTuple):
    """The place of a car's base: metres and radians, yaw in (-pi, pi]."""

    x: float
    y: float
    yaw: float

    def ahead(self, forward: float, left: float = 0.0) -> tuple[float, float]:
        """The point ``forward`` metres before and ``left`` metres beside the base."""
        x, y, yaw = self
        cos, sin = math.cos(yaw), math.sin(yaw)
        return x + forward * cos - left * sin, y + forward * sin + left * cos


class Car:
    """One car in a Bullet world. Made by :meth:`paddock.simulator.world.World.add_car`."""

    def __init__(self, client: int, physics: CarPhysics) -> None:
        self.physics = physics
        self._client = client
        self.body = _build(client, physics)
        self._reach = [0.0] + [1.0 / (1.0 - (1.0 - physics.motor_gain) ** moves) for moves in range(1, MAX_STRIDE + 1)]
        # Forces, position gains and velocity gains of the joints' motors.
        self._motors = (
            tuple(physics.steering_torque if joint in HINGES else physics.wheel_torque for joint in _JOINTS),
            tuple(physics.motor_gain if joint in HINGES else 0.0 for joint in _JOINTS),
            tuple(1.0 if joint in HINGES else physics.motor_gain for joint in _JOINTS),
        )
        self._motor_targets: tuple[float, ...] | None = None
        self._pose: Pose | None = None
        self.place(Pose(0.0, 0.0, 0.0))

    def renew(self) -> None:
        """Make it equal to a new car to the last bit: setting the filters again drops the contact points from which
        Bullet would start its next solution."""
        _set_filters(self.body, self._client)
        self.place(Pose(0.0, 0.0, 0.0))

    @property
    def pose(self) -> Pose:
        """The present place of the base, cached until the world moves."""
        return self.moved() if self._pose is None else self._pose

    def moved(self) -> Pose:
        """Read the pose from Bullet after the world has moved."""
        (x, y, _), (qx, qy, qz, qw) = bullet.getBasePositionAndOrientation(self.body, self._client)
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        self._pose = pose = _made(Pose, (x, y, yaw))
        return pose

    @property
    def height(self) -> float:
        """Metres of the axles above the ground; the wheels' radius while the car stands on it."""
        lift = self.physics.wheel_radius - self.physics.mass_height
        return bullet.getBasePositionAndOrientation(self.body, self._client)[0][2] + lift

    @property
    def speed(self) -> float:
        """Metres a second over the ground."""
        (vx, vy, _), _ = bullet.getBaseVelocity(self.body, self._client)
        return math.sqrt(vx * vx + vy * vy)

    def place(self, pose: Pose) -> None:
        """Put the car there, standing still, wheels straight, nothing commanded."""
        self.start(pose, Response(self.physics))

    def start(self, pose: Pose, response: Response) -> None:
        """Put the car there in motion with ``response``, which the car takes over."""
        physics, client, body = self.physics, self._client, self.body
        self.response = response
        half = pose.yaw / 2.0
        turned = (0.0, 0.0, math.sin(half), math.cos(half))
        bullet.resetBasePositionAndOrientation(body, (pose.x, pose.y, physics.mass_height), turned, client)
        rate = response.speed * response.curvature
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        aside = -physics.rear_axle_x * rate  # it is the rear axle that moves straight ahead
        velocity = (response.speed * cos - aside * sin, response.speed * sin + aside * cos, 0.0)
        bullet.resetBaseVelocity(body, velocity, (0.0, 0.0, rate), client)
        self._joints = joints = self._wanted()
        for joint, angle in zip(HINGES, joints[:2], strict=True):
            bullet.resetJointState(body, joint, angle, 0.0, client)
        for joint, spin in zip(WHEELS, joints[2:], strict=True):
            bullet.resetJointState(body, joint, 0.0, spin, client)
        self._pose = None
        self._motor_targets = None
        self._tell(joints)

    def command(self, steering_deg: float, speed: float) -> None:
        """Take a command (degrees to the left, m/s); it reaches the motors after its dead time."""
        self.response.command(steering_deg, speed)

    def drive(self, ticks: int) -> None:
        """Set the motors for the next ``ticks`` ticks of the response (at most ``MAX_STRIDE``)."""
        self.response.advance(ticks)
        a, b, c, d, e, f = self._joints
        self._joints = u, v, w, x, y, z = self._wanted()
        # A motor removes a fixed share of the difference in every move: aimed so far beyond, it arrives in time.
        reach = self._reach[self.physics.moves(ticks)]
        self._tell(
            (
                *(a + (u - a) * reach, b + (v - b) * reach, c + (w - c) * reach),
                *(d + (x - d) * reach, e + (y - e) * reach, f + (z - f) * reach),
            )
        )

    def _wanted(self) -> tuple[float, ...]:
        """The targets of the joints: angles (rad) of both hinges by Ackermann, spins (rad/s) of the four wheels by an
        electronic differential."""
        physics, response = self.physics, self.response
        curvature = response.curvature
        side, rise = physics.half_track * curvature, physics.wheelbase * curvature
        left, right = 1.0 - side, 1.0 + side
        spin = response.speed / physics.wheel_radius
        return (
            math.atan(rise / left),
            math.atan(rise / right),
            spin * left,
            spin * right,
            # not math.hypot, whose last bit differs from Python to Python
            spin * math.sqrt(left * left + rise * rise),
            spin * math.sqrt(right * right + rise * rise),
        )

    def _tell(self, targets: tuple[float, ...]) -> None:
        """Give the motors their targets unless they have them."""
        if self._motor_targets == targets:
            return
        self._motor_targets = targets
        left, right, rear_left, rear_right, front_left, front_right = targets
        # One call for all: to Bullet a velocity motor is a position motor without a position gain.
        bullet.setJointMotorControlArray(
            self.body,
            _JOINTS,
            bullet.POSITION_CONTROL,
            (0.0, 0.0, left, 0.0, right, 0.0),
            (rear_left, rear_right, 0.0, front_left, 0.0, front_right),
            *self._motors,
            self._client,
        )


def _build(client: int, physics: CarPhysics) -> int:
    """Create the multibody, with our inertias in place of Bullet's guesses."""
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
    # One kind of change a call: Bullet applies damping and joint speed to the chassis, whatever the link.
    bullet.changeDynamics(body, -1, localInertiaDiagonal=physics.chassis_inertia, physicsClientId=client)
    bullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=client)
    bullet.changeDynamics(body, -1, maxJointVelocity=physics.max_joint_velocity, physicsClientId=client)
    _set_filters(body, client)
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


def _set_filters(body: int, client: int) -> None:
    """Only wheels collide, and only with the ground."""
    for link in (-1, *_JOINTS):
        bullet.setCollisionFilterGroupMask(body, link, CAR_GROUP, GROUND_GROUP if link in WHEELS else 0, client)
