"""Runs a whole race of one or several cars in one world: policies in, laps and traces out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import MAX_CARS, RaceRules
from paddock.rules.speed import SpeedCommand

from .action import Action, ActionSpace
from .camera.theme import OFFICIAL, Theme
from .competitor import Competitor
from .cruise import AskedPolicy, Cruise
from .engine import ENGINE_ID, versions
from .layout import LayoutDocument
from .physics import PADDOCK_CAR, CarPhysics
from .referee import LAPS_DONE, RETIRED
from .results import CarProgress, CompetitorRun, Fault, Progress, RaceResult, RivalProgress
from .stage import PreparedTrack, Simulation
from .world import World

if TYPE_CHECKING:
    from .randomisation import Disturbance

# Maps the sensor readings by name to the input of paddock.simulator.action.ActionSpace.decode.
Policy = Callable[[dict[str, np.ndarray]], np.ndarray | list[float] | int]


@dataclass(frozen=True)
class Entrant:
    """A car in a race and its policy.

    ``action_space``: maps the network's output to steering and speed. ``sensors``: their names. ``lidar_config``: of a
    LIDAR, None for the default. ``places``: an array for each sensor that receives its readings; ``policy`` then gets
    this very dict in every step, or fresh arrays where its car is disturbed. None: fresh arrays in every step.
    ``asked``: what C may ask in place of ``policy`` when ``places`` are filled.
    """

    action_space: ActionSpace
    sensors: Sequence[str]
    policy: Policy
    lidar_config: Mapping[str, float] | None = None
    places: dict[str, np.ndarray] | None = None
    asked: AskedPolicy | None = None


@dataclass(frozen=True)
class RaceSettings:
    """Everything that :func:`run_race` takes.

    ``track``: in its own direction; the rules name the direction driven. ``cars``: 1 to MAX_CARS in the order of the
    grid; laps, trace and progress of a result are those of the first. ``start_m``: metres from the track's first
    waypoint to the finish line; boxes stay (default: of the rules). ``disturbance``: changes of light, start, sensors
    or latency; for one car alone. ``ground``: the track, prepared for this direction and theme (default: prepared
    here). ``world``: an unused world with these physics, which the caller closes.

    ``on_progress``: called every ``progress_every_steps`` control steps (1/15 s each) while ``progress_due`` returns
    True, and at the end.

    Raises ValueError for too many cars, and for several with a disturbance.
    """

    track: TrackGeometry
    rules: RaceRules
    cars: Sequence[Entrant]
    theme: Theme = OFFICIAL
    physics: CarPhysics = PADDOCK_CAR
    start_m: float | None = None
    disturbance: Disturbance | None = None
    ground: PreparedTrack | None = None
    world: World | None = None
    on_progress: Callable[[Progress], None] | None = None
    progress_every_steps: int = 15
    progress_due: Callable[[], bool] = lambda: True

    def __post_init__(self) -> None:
        if not 1 <= len(self.cars) <= MAX_CARS:
            raise ValueError(f"1 to {MAX_CARS} cars race in one world, not {len(self.cars)}")
        if len(self.cars) > 1 and self.disturbance is not None:
            raise ValueError("a disturbance needs a car that races alone")


def run_race(settings: RaceSettings) -> RaceResult:
    """Race one car, or several in the same world.

    All cars observe before any of them acts. Several start from a grid (see
    :meth:`paddock.simulator.stage.Simulation.add`); the same rules time all of them from the same signal over the same
    line. The race ends when no car drives any more.

    An error of a policy passes through; among several cars a UserFault retires the car instead, and its laps stand.
    Raises UserFault where boxes or bots have no room.
    """
    begun = perf_counter()
    on_progress, every, is_due = settings.on_progress, settings.progress_every_steps, settings.progress_due
    ground = settings.ground or PreparedTrack(settings.track, settings.rules.direction, settings.theme)
    with Simulation(ground, settings.rules, settings.physics, settings.world) as stage:
        race = _Race(stage, settings)
        first = race.cars[0]
        step = race.step_alone if len(race.cars) == 1 else race.step
        while not race.over:
            step()
            if on_progress is not None and race.steps % every == 0 and not race.over and is_due():
                race.settle()
                on_progress(_progress_of(first, stage))
        if on_progress is not None:
            on_progress(_progress_of(first, stage))
        own, *rivals = [
            CompetitorRun(
                laps=car.lap_results(),
                end_reason=car.referee.end_reason or "",
                simulated_ms=car.referee.time_ms,
                steps=car.referee.step,
                trace=car.trace(),
                retired=race.retired[number],
            )
            for number, car in enumerate(race.cars)
        ]
        physics_s = stage.world.seconds
        bots = [
            [(round(pose.x, 3), round(pose.y, 3), round(pose.yaw, 3)) for pose in path]
            for path in zip(*stage.bot_rows, strict=True)
        ]
        layout: LayoutDocument = {**stage.layout.to_dict(), "bots": bots}
    total_s = perf_counter() - begun
    return RaceResult(
        **vars(own),
        engine=ENGINE_ID,
        versions=versions(),
        seconds={
            "physics": physics_s,
            "camera": race.camera_s,
            "policy": race.policy_s,
            "other": total_s - physics_s - race.camera_s - race.policy_s,
        },
        layout=layout,
        rivals=rivals,
        order=race.order(),
    )


class CommandedSpeeds:
    """The log of one car's speed commands, followed as its clock goes on."""

    def __init__(self, commands: Sequence[SpeedCommand]) -> None:
        self._coming = list(reversed(commands))
        self._now: SpeedCommand | None = None

    def __call__(self, action: Action, time_ms: int) -> Action:
        """The model's action with the speed that is commanded at ``time_ms`` of the run."""
        while self._coming and self._coming[-1].at_ms <= time_ms:
            self._now = self._coming.pop()
        return action if self._now is None else action._replace(speed_mps=self._now.speed_of(action.speed_mps))


class _Race:
    def __init__(self, stage: Simulation, settings: RaceSettings) -> None:
        entrants, commands = settings.cars, settings.rules.speed_commands
        start_m = settings.rules.start_m if settings.start_m is None else settings.start_m
        if any(one.car >= len(entrants) for one in commands):
            most = max(one.car for one in commands)
            raise ValueError(f"speed_commands name car {most}, and there are {len(entrants)}")
        self._stage = stage
        self._disturbance = disturbance = settings.disturbance
        self._entrants = entrants
        alone = len(entrants) == 1
        self.cars = [
            stage.add(entrant.sensors, start_m, entrant.lidar_config, grid=None if alone else number)
            for number, entrant in enumerate(entrants)
        ]
        if disturbance is not None and disturbance.moves_the_start:
            (car,), track = self.cars, stage.ground.track
            car.begin_at(disturbance.place(car.referee.pose, track.width_at(start_m % track.length)))
        self.retired: list[Fault | None] = [None] * len(entrants)
        self._speeds = {
            number: CommandedSpeeds([one for one in commands if one.car == number])
            for number in {one.car for one in commands}
        }
        self.steps = 0
        self.over = False
        self._cruise: Cruise | None = None
        if alone and not self._speeds and stage.bots is None:
            self._cruise = Cruise.of(self.cars[0], entrants[0] if disturbance is None else None)
        self._ahead: Action | None = None  # of the next step, if its network was asked at the end of the last
        self._camera_s = self._policy_s = 0.0

    @property
    def camera_s(self) -> float:
        return self._camera_s + (self._cruise.camera_s if self._cruise else 0.0)

    @property
    def policy_s(self) -> float:
        return self._policy_s + (self._cruise.policy_s if self._cruise else 0.0)

    def step(self) -> None:
        actions: list[Action | None] = []
        failed: list[Competitor] = []
        for number, car in enumerate(self.cars):
            action = None
            if not (car.done or car.pausing):
                try:
                    action = self._action(number, car)
                except UserFault as fault:
                    self.retired[number] = {"code": fault.code, "params": fault.params}
                    failed.append(car)
            actions.append(action)
        for car in failed:  # after all have observed
            self._stage.retire(car)
        if failed:
            self.over = self._all_done()
        if not self.over:
            self._stage.step(actions)
            self.steps += 1
            self.over = self._all_done()

    def step_alone(self) -> None:
        """The same for a single car, faster."""
        car, cruise, action = self.cars[0], self._cruise, self._ahead
        if action is None and car.referee.pause_steps <= 0:
            action = self._action(0, car)
        self._ahead = None
        if cruise is not None and cruise.on:
            assert action is not None, "a cruising car does not pause"
            car.car.response.command(action.steering_deg, action.speed_mps)  # as Car.command
            self._stage.world.step()
            self._ahead = cruise.step(action)
        else:
            self._stage.step((action,))
        self.steps += 1
        if cruise is None or not cruise.on:
            self.over = car.referee.end_reason is not None
            if cruise is not None:
                cruise.begin()

    def settle(self) -> None:
        """Bring the cars and their referees up to date."""
        if self._cruise is not None:
            self._cruise.settle()

    def _all_done(self) -> bool:
        return all([car.done for car in self.cars])

    def _action(self, number: int, car: Competitor) -> Action:
        """The command of a car, from its network and from speed commands of its racer."""
        entrant = self._entrants[number]
        disturbance = self._disturbance
        begun = perf_counter()
        readings = car.observe(entrant.places)
        if disturbance is not None:
            readings = disturbance.observe(readings)
        observed = perf_counter()
        output = entrant.policy(readings)
        answered = perf_counter()
        self._camera_s += observed - begun
        self._policy_s += answered - observed
        action = entrant.action_space.decode(output, self.steps + 1)
        if disturbance is not None:
            action = disturbance.act(action)
        speeds = self._speeds.get(number) if self._speeds else None
        return action if speeds is None else speeds(action, car.referee.time_ms)

    def order(self) -> list[int]:
        """The cars from the winner on: those that did all laps by their times, the others by the distance they drove,
        those that retired last; equal ones in the order of the grid."""

        def rank(number: int) -> tuple[int, float]:
            referee = self.cars[number].referee
            if referee.end_reason == LAPS_DONE:
                return 0, referee.time_ms
            return (2 if referee.end_reason == RETIRED else 1), -referee.odometer.metres

        return sorted(range(len(self.cars)), key=rank)


def _progress_of(car: Competitor, stage: Simulation) -> Progress:
    referee = car.referee
    lap = referee.lap
    finished = [done.end_ms - done.start_ms for done in referee.laps if done.end_ms is not None]
    return Progress(
        **vars(_car_progress(car)),
        laps=referee.rules.laps,
        lap_ms=(lap.end_ms or referee.time_ms) - lap.start_ms,
        resets=referee.resets,
        last_lap_ms=finished[-1] if finished else None,
        bots=[(round(pose.x, 3), round(pose.y, 3)) for pose in stage.bots.poses] if stage.bots else [],
        rivals=[
            RivalProgress(**vars(_car_progress(other)), retired=other.referee.end_reason == RETIRED)
            for other in stage.competitors
            if other is not car
        ],
    )


def _car_progress(car: Competitor) -> CarProgress:
    referee = car.referee
    x, y = referee.nose
    return CarProgress(
        lap=referee.lap.number,
        total_ms=referee.time_ms,
        percent=round(referee.percent, 2),
        x=round(x, 3),
        y=round(y, 3),
        off_tracks=sum(lap.off_tracks for lap in referee.laps),
        crashes=referee.crashes,
    )
