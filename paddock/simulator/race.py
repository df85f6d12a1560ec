"""A whole race, of one car or of several in one world: policies in, laps and traces out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from paddock.errors import UserFault
from paddock.geometry.track import TrackGeometry
from paddock.rules.race import MAX_CARS, RaceRules
from paddock.rules.speed import SpeedCommand

from .action import Action, ActionSpace
from .camera.theme import OFFICIAL, Theme
from .competitor import Competitor
from .cruise import Cruise
from .engine import ENGINE_ID, versions
from .physics import PADDOCK_CAR, CarPhysics
from .randomisation import Disturbance
from .referee import LAPS_DONE, RETIRED, Lap
from .speeds import commanded_speeds
from .stage import PreparedTrack, Simulation
from .trace import LABELS, Trace
from .world import World

# Answers as paddock.simulator.action.ActionSpace.decode takes them.
Policy = Callable[[dict[str, np.ndarray]], np.ndarray | list[float] | int]


@dataclass(frozen=True)
class LapResult:
    """One lap. Times in whole simulated milliseconds; ``sector_ms`` has three values when the lap is complete, else
    those of the sectors driven. ``time_ms`` of an incomplete lap is the time spent in it."""

    number: int
    start_ms: int
    time_ms: int
    complete: bool
    off_tracks: int
    crashes: int
    resets: int
    immobilised: int
    reversals: int
    sector_ms: list[int]
    completion_percentage: int
    status: str  # a label of LABELS

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class Entrant:
    """A car that races and who drives it. ``policy`` gets a dict of sensor readings and returns the network's
    output. ``places``: as for :func:`run_race`."""

    action_space: ActionSpace
    sensors: Sequence[str]
    policy: Policy
    lidar_config: Mapping[str, float] | None = None
    places: dict[str, np.ndarray] | None = None


@dataclass(frozen=True)
class RivalProgress:
    """How another car stands while a race runs. ``retired`` tells of a car whose policy failed."""

    lap: int
    percent: float
    total_ms: int
    x: float
    y: float
    off_tracks: int
    crashes: int
    retired: bool


@dataclass(frozen=True)
class Progress:
    """How a race stands while it runs, seen by its first car. ``bots``: x and y of each, metres."""

    lap: int
    laps: int
    lap_ms: int
    total_ms: int
    percent: float
    x: float
    y: float
    off_tracks: int
    crashes: int
    resets: int
    last_lap_ms: int | None
    bots: list[tuple[float, float]] = field(default_factory=list)
    rivals: list[RivalProgress] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class CompetitorRun:
    """What one car of several came to. ``retired``: the fault of its policy as ``{"code", "params"}``, or None."""

    laps: list[LapResult]
    end_reason: str  # "laps_done", "time_up", "resets_used" or "retired"
    simulated_ms: int
    steps: int
    trace: Trace
    retired: dict[str, Any] | None = None


@dataclass(frozen=True)
class RaceResult:
    """What a race came to; laps, trace and the like are those of the first car. Everything but ``seconds`` is the same
    on every run.

    ``layout``: ``{"boxes": [{"fraction", "lane", "x", "y", "yaw"}], "bots": [[(x, y, yaw), ...], ...]}``, for each bot
    one place for each row of the first car's trace, in metres and radians to a thousandth. ``order``: the cars from the
    winner on, 0 being the first car and 1 the first of ``rivals``.
    """

    laps: list[LapResult]
    end_reason: str  # "laps_done", "time_up", "resets_used" or, with rivals, "retired"
    simulated_ms: int
    steps: int
    trace: Trace
    engine: str
    versions: dict[str, str]
    seconds: dict[str, float] = field(compare=False)  # of wall time in physics, camera, policy, other: a diagnostic
    layout: dict[str, Any] = field(default_factory=dict)
    rivals: list[CompetitorRun] = field(default_factory=list)
    order: list[int] = field(default_factory=lambda: [0])
    retired: dict[str, Any] | None = None


def run_race(
    track: TrackGeometry,
    rules: RaceRules,
    action_space: ActionSpace,
    sensors: Sequence[str],
    policy: Policy,
    on_progress: Callable[[Progress], None] | None = None,
    progress_every_steps: int = 15,
    *,
    rivals: Sequence[Entrant] = (),
    lidar_config: Mapping[str, float] | None = None,
    theme: Theme = OFFICIAL,
    physics: CarPhysics = PADDOCK_CAR,
    start_m: float | None = None,
    ground: PreparedTrack | None = None,
    disturbance: Disturbance | None = None,
    progress_due: Callable[[], bool] = lambda: True,
    world: World | None = None,
    places: dict[str, np.ndarray] | None = None,
) -> RaceResult:
    """Race one car, alone or against ``rivals`` in the same world, and return the result.

    All cars look before any of them acts. They start from a grid (see :meth:`paddock.simulator.stage.Simulation.add`)
    and are timed by the same rules from the same signal over the same line; the race is over when no car drives any
    more.

    ``policy`` gets a dict of sensor readings and returns the network's output. It may raise: the race of a car alone is
    then over without a result, and so it is for any error but a UserFault; of several cars the one whose policy raises
    a UserFault retires, and its laps stand. ``on_progress`` is told every ``progress_every_steps`` control steps where
    ``progress_due`` then says so, and at the end. ``start_m`` (None: that of the rules) moves start and finish along
    the track, but no box. ``ground``: that of this track, direction and theme, where somebody has built it up already.
    ``disturbance``: what is other than usual for a car alone; no race of several has one. ``world``: one with these
    physics that nobody has used; whoever hands it over closes it, when there is time. ``places``: an
    array for each sensor, which gets the readings; ``policy`` then gets this very dict in every step, or a dict of
    fresh arrays where its car is disturbed; without, it gets fresh arrays.

    Raises UserFault where boxes or bots have no room, ValueError for more cars than a world takes and for several that
    are to be disturbed.
    """
    if len(rivals) >= MAX_CARS:
        raise ValueError(f"at most {MAX_CARS} cars race in one world, not {1 + len(rivals)}")
    if rivals and disturbance is not None:
        raise ValueError("only a car alone is disturbed")
    begun = perf_counter()
    entrants = [Entrant(action_space, sensors, policy, lidar_config, places), *rivals]
    with Simulation(ground or PreparedTrack(track, rules.direction, theme), rules, physics, world) as stage:
        begins_m = rules.start_m if start_m is None else start_m
        race = _Race(stage, entrants, begins_m, rules.speed_commands, disturbance)
        first = race.cars[0]
        while not race.over:
            race.step()
            if on_progress is not None and race.steps % progress_every_steps == 0 and not race.over and progress_due():
                race.settle()
                on_progress(progress_of(first, stage))
        if on_progress is not None:
            on_progress(progress_of(first, stage))
        results = [
            CompetitorRun(
                laps=lap_results(car),
                end_reason=car.referee.end_reason or "",
                simulated_ms=car.referee.time_ms,
                steps=car.referee.step,
                trace=car.trace(),
                retired=race.retired[number],
            )
            for number, car in enumerate(race.cars)
        ]
        physics_s = stage.world.seconds
        layout = stage.layout.to_dict() | {"bots": _bot_paths(stage)}
    total_s = perf_counter() - begun
    own = results[0]
    return RaceResult(
        laps=own.laps,
        end_reason=own.end_reason,
        simulated_ms=own.simulated_ms,
        steps=own.steps,
        trace=own.trace,
        engine=ENGINE_ID,
        versions=versions(),
        seconds={
            "physics": physics_s,
            "camera": race.camera_s,
            "policy": race.policy_s,
            "other": total_s - physics_s - race.camera_s - race.policy_s,
        },
        layout=layout,
        rivals=results[1:],
        order=race.order(),
        retired=own.retired,
    )


class _Race:
    """A race while it runs."""

    def __init__(
        self,
        stage: Simulation,
        entrants: Sequence[Entrant],
        start_m: float,
        commands: Sequence[SpeedCommand],
        disturbance: Disturbance | None = None,
    ) -> None:
        self._stage = stage
        self._disturbance = disturbance
        self._entrants = entrants
        alone = len(entrants) == 1
        self.cars = [
            stage.add(entrant.sensors, start_m, entrant.lidar_config, grid=None if alone else number)
            for number, entrant in enumerate(entrants)
        ]
        if disturbance is not None and disturbance.moves_the_start:
            (car,), track = self.cars, stage.ground.track
            car.begin_at(disturbance.place(car.referee.pose, track.width_at(start_m % track.length)))
        self.retired: list[dict[str, Any] | None] = [None] * len(entrants)
        self._speeds = commanded_speeds(commands, len(entrants))
        self.steps = 0
        self.over = False
        self._cruise = Cruise.of(self.cars[0]) if alone and not self._speeds and stage.bots is None else None
        self.camera_s = self.policy_s = 0.0

    def step(self) -> None:
        """One control step of all cars."""
        if len(self.cars) == 1:
            self._step_alone()
            return
        actions: list[Action | None] = []
        failed: list[Competitor] = []
        for number, car in enumerate(self.cars):
            action = None
            if not (car.done or car.pausing):
                try:
                    action = self._ask(number, car)
                except UserFault as fault:
                    self.retired[number] = {"code": fault.code, "params": fault.params}
                    failed.append(car)
            actions.append(action)
        for car in failed:  # after all have looked
            self._stage.retire(car)
        if failed:
            self.over = self._all_done()
        if not self.over:
            self._stage.step(actions)
            self.steps += 1
            self.over = self._all_done()

    def _step_alone(self) -> None:
        """The same where there is one: what it raises goes through."""
        car, cruise = self.cars[0], self._cruise
        if cruise is not None and cruise.on:
            action = self._ask(0, car)
            car.car.command(action.steering_deg, action.speed_mps)
            self._stage.world.step()
            cruise.step(action)
        else:
            self._stage.step((None if car.referee.pause_steps > 0 else self._ask(0, car),))
        self.steps += 1
        if cruise is None or not cruise.on:
            self.over = car.referee.end_reason is not None
            if cruise is not None:
                cruise.begin()

    def settle(self) -> None:
        """Cars and their referees are asked now."""
        if self._cruise is not None:
            self._cruise.settle()

    def _all_done(self) -> bool:
        return all([car.done for car in self.cars])

    def _ask(self, number: int, car: Competitor) -> Action:
        """What a car is told to do, by its network and by who commands its speed."""
        entrant = self._entrants[number]
        disturbance = self._disturbance
        looked = perf_counter()
        readings = car.observe(entrant.places)
        if disturbance is not None:
            readings = disturbance.observe(readings)
        asked = perf_counter()
        output = entrant.policy(readings)
        answered = perf_counter()
        self.camera_s += asked - looked
        self.policy_s += answered - asked
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


def _bot_paths(stage: Simulation) -> list[list[tuple[float, float, float]]]:
    """For each bot its places, one for each row of the first car's trace."""
    return [
        [(round(pose.x, 3), round(pose.y, 3), round(pose.yaw, 3)) for pose in path]
        for path in zip(*stage.bot_rows, strict=True)
    ]


def lap_results(car: Competitor) -> list[LapResult]:
    """The laps driven so far, the unfinished one last."""
    return [_lap_result(lap, car) for lap in car.referee.laps]


def _lap_result(lap: Lap, car: Competitor) -> LapResult:
    complete = lap.end_ms is not None
    end_ms = lap.end_ms if lap.end_ms is not None else car.referee.time_ms
    starts = [lap.start_ms, *lap.sector_ends_ms]
    return LapResult(
        number=lap.number,
        start_ms=lap.start_ms,
        time_ms=end_ms - lap.start_ms,
        complete=complete,
        off_tracks=lap.off_tracks,
        crashes=lap.crashes,
        resets=lap.resets,
        immobilised=lap.immobilised,
        reversals=lap.reversals,
        sector_ms=[after - before for before, after in zip(starts, lap.sector_ends_ms, strict=False)],
        completion_percentage=100 if complete else max(0, math.floor(car.referee.percent)),
        status=LABELS["lap_complete" if complete else car.status],
    )


def progress_of(car: Competitor, stage: Simulation) -> Progress:
    """The state of a running race for those who watch ``car``."""
    referee = car.referee
    lap = referee.lap
    finished = [done.end_ms - done.start_ms for done in referee.laps if done.end_ms is not None]
    x, y = referee.nose
    return Progress(
        lap=lap.number,
        laps=referee.rules.laps,
        lap_ms=(lap.end_ms or referee.time_ms) - lap.start_ms,
        total_ms=referee.time_ms,
        percent=round(referee.percent, 2),
        x=round(x, 3),
        y=round(y, 3),
        off_tracks=sum(done.off_tracks for done in referee.laps),
        crashes=referee.crashes,
        resets=referee.resets,
        last_lap_ms=finished[-1] if finished else None,
        bots=[(round(pose.x, 3), round(pose.y, 3)) for pose in stage.bots.poses] if stage.bots else [],
        rivals=[_rival_progress(other) for other in stage.competitors if other is not car],
    )


def _rival_progress(car: Competitor) -> RivalProgress:
    referee = car.referee
    x, y = referee.nose
    return RivalProgress(
        lap=referee.lap.number,
        percent=round(referee.percent, 2),
        total_ms=referee.time_ms,
        x=round(x, 3),
        y=round(y, 3),
        off_tracks=sum(lap.off_tracks for lap in referee.laps),
        crashes=referee.crashes,
        retired=referee.end_reason == RETIRED,
    )
