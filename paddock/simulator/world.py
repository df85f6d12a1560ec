"""The physical world: one fresh Bullet client, a ground plane, and cars that move on a fixed tick."""

from __future__ import annotations

from time import perf_counter

import pybullet as bullet

from .car import Car
from .physics import PADDOCK_CAR, CarPhysics

_ready: list[World] = []  # unused


def make_ready() -> None:
    """Build the next world with its first car, which takes twenty milliseconds."""
    world = World()
    world.build_ahead()
    _ready.append(world)


def new_world(physics: CarPhysics = PADDOCK_CAR) -> World:
    """An unused world with these physics, if possible one prepared before."""
    return _ready.pop() if _ready and _ready[-1].physics == physics else World(physics)


def _connect() -> int:
    """A client that compares every body with every other: faster for so few than Bullet's tree, same result."""
    client = bullet.connect(bullet.DIRECT)
    bullet.resetSimulation(bullet.RESET_USE_SIMPLE_BROADPHASE, client)
    return client


class World:
    """A Bullet client with fixed ticks; with a fresh one each run repeats to the last bit. Use it as a context manager
    or call :meth:`close`."""

    def __init__(self, physics: CarPhysics = PADDOCK_CAR) -> None:
        self.physics = physics
        self.cars: list[Car] = []
        self._idle: list[Car] = []
        self._new: list[Car] = []  # built ahead
        self.seconds = 0.0  # wall time in calls of Bullet; a diagnostic
        self.client = _connect()
        self._stride = 0  # ticks that Bullet's clock is set for
        self._prepare()

    def _prepare(self) -> None:
        physics, client = self.physics, self.client
        bullet.setGravity(0.0, 0.0, -physics.gravity, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            numSolverIterations=physics.solver_iterations,
            deterministicOverlappingPairs=1,
            # Metres after which a contact point of a rolling sphere is dropped; Bullet's 0.02 doubles the solver's work
            # for the same lap times.
            contactBreakingThreshold=0.001,
            solverResidualThreshold=0.0,  # all iterations, so that no car's path depends on another's
            physicsClientId=client,
        )
        self._set_clock(physics.ticks_per_step)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=(0, 0, 1), physicsClientId=client)
        # A plane without a visual shape costs Bullet milliseconds.
        speck = bullet.createVisualShape(bullet.GEOM_SPHERE, radius=0.001, physicsClientId=client)
        ground = bullet.createMultiBody(0, plane, speck, physicsClientId=client)
        bullet.changeDynamics(
            ground,
            -1,
            lateralFriction=1.0,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            physicsClientId=client,
        )

    def add_car(self) -> Car:
        """A new car at the origin, or a renewed one that was given back."""
        if self._idle:
            car = self._idle.pop()
            car.renew()
        else:
            car = self._new.pop() if self._new else Car(self.client, self.physics)
        self.cars.append(car)
        return car

    def build_ahead(self) -> None:
        """Build the next car for :meth:`add_car`."""
        self._new.append(Car(self.client, self.physics))

    def give_back(self, car: Car) -> None:
        """Keep a car whose run is over for :meth:`add_car`: a renewal costs a fiftieth of a new car."""
        self.cars.remove(car)
        self._idle.append(car)

    def remove_car(self, car: Car) -> None:
        self.cars.remove(car)
        bullet.removeBody(car.body, physicsClientId=self.client)

    def step(self, ticks: int | None = None) -> None:
        """Advance one control step (1/15 s), or one of so many ticks of the response (1/120 s)."""
        before = perf_counter()
        physics = self.physics
        if ticks is None:
            ticks = physics.ticks_per_step
        calls = self._set_clock(ticks)
        for car in self.cars:
            car.drive(ticks)
        for _ in range(calls):
            bullet.stepSimulation(self.client)
        for car in self.cars:
            car.moved()
        self.seconds += perf_counter() - before

    def _set_clock(self, ticks: int) -> int:
        """Set the length of Bullet's next moves and return the number of calls for them. Call it before motors get
        their targets: Bullet computes their limits with the current length."""
        # One call for all moves where the step divides without rounding.
        moves = self.physics.moves(ticks)
        calls = 1 if moves & (moves - 1) == 0 else moves
        if ticks != self._stride:
            self._stride = ticks
            bullet.setPhysicsEngineParameter(
                fixedTimeStep=ticks / self.physics.tick_hz / calls,
                numSubSteps=moves // calls,
                physicsClientId=self.client,
            )
        return calls

    def close(self) -> None:
        """Free the Bullet client; may be called twice."""
        if self.client >= 0:
            bullet.disconnect(self.client)
            self.client = -1

    def __del__(self) -> None:
        # An unclosed environment must not use up Bullet's thousand clients.
        if getattr(self, "client", -1) >= 0 and bullet is not None:
            self.close()

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()
