"""The physical world: one fresh Bullet client, a ground plane, and cars that move on a fixed tick."""

from __future__ import annotations

from time import perf_counter
from types import TracebackType

import pybullet as bullet

from .car import Car
from .physics import PADDOCK_CAR, CarPhysics

_ready: list[World] = []  # that nobody has used


def make_ready() -> None:
    """Build the next world now, and its first car; that takes twenty milliseconds, which are free while nobody
    waits."""
    world = World()
    world.build_ahead()
    _ready.append(world)


def new_world(physics: CarPhysics = PADDOCK_CAR) -> World:
    """A world that nobody has used: the one that was made ready, if there is one with these physics."""
    return _ready.pop() if _ready and _ready[-1].physics == physics else World(physics)


def _connect() -> int:
    """A client whose broad phase holds every body against every other: a car is seven of them and the ground is one,
    and Bullet's tree of boxes costs a fourteenth of its whole step. The results are the same to the last bit."""
    client = bullet.connect(bullet.DIRECT)
    bullet.resetSimulation(bullet.RESET_USE_SIMPLE_BROADPHASE, client)
    return client


class World:
    """A Bullet world of its own. Use it as a context manager or call :meth:`close`.

    A fresh client for each run and fixed ticks make a run repeat to the last bit.
    """

    def __init__(self, physics: CarPhysics = PADDOCK_CAR) -> None:
        self.physics = physics
        self.cars: list[Car] = []
        self._idle: list[Car] = []
        self._new: list[Car] = []  # built ahead
        self.seconds = 0.0  # spent in Bullet's step, and in telling and asking it of the cars; a diagnostic
        self.client = _connect()
        self._stride = 0  # ticks that Bullet's clock is set for
        self._prepare()

    def _prepare(self) -> None:
        physics, client = self.physics, self.client
        bullet.setGravity(0.0, 0.0, -physics.gravity, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            numSolverIterations=physics.solver_iterations,
            deterministicOverlappingPairs=1,
            # A rolling sphere leaves contact points behind, which are kept until they are so many metres away. Bullet's
            # 0.02 keeps up to three a wheel at walking pace: the same lap times for twice the solver's work.
            contactBreakingThreshold=0.001,
            solverResidualThreshold=0.0,  # always all iterations, so that one car's path does not hang on another's
            physicsClientId=client,
        )
        self._set_clock(physics.ticks_per_step)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=(0, 0, 1), physicsClientId=client)
        # Nobody looks through Bullet's eyes, but it spends milliseconds on a picture of a plane that has none.
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
        """A new car at the origin; one that was given back serves again."""
        if self._idle:
            car = self._idle.pop()
            car.renew()
        else:
            car = self._new.pop() if self._new else Car(self.client, self.physics)
        self.cars.append(car)
        return car

    def build_ahead(self) -> None:
        """Build the next car, which :meth:`add_car` then hands out."""
        self._new.append(Car(self.client, self.physics))

    def give_back(self, car: Car) -> None:
        """The car's run is over; it drives on idle until :meth:`add_car` makes it a new one, which costs a fiftieth of
        building another."""
        self.cars.remove(car)
        self._idle.append(car)

    def remove_car(self, car: Car) -> None:
        """Take a car out of the world."""
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
            car.moved()  # and where to: Bullet's answer is Bullet's time
        self.seconds += perf_counter() - before

    def _set_clock(self, ticks: int) -> int:
        """Tell Bullet how long its next moves are; returns how many calls they take. Before motors are told anything:
        Bullet reckons their limits with the length that it knows then."""
        # One call for all moves; where they divide without rounding, which Bullet's own clock would stumble over.
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
        # An environment that nobody closed must not use up Bullet's thousand clients.
        if getattr(self, "client", -1) >= 0 and bullet is not None:
            self.close()

    def __enter__(self) -> World:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
