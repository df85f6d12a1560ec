"""A whole race of one car: policy in, laps and trace out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from tracks.geometry import TrackGeometry

from .action import ActionSpace
from .camera.theme import OFFICIAL, Theme
from .contestant import Contestant
from .engine import ENGINE_ID, versions
from .physics import PADDOCK_CAR, CarPhysics
from .referee import Lap
from .rules import RaceRules
from .stage import Ground, Stage
from .trace import Trace

Policy = Callable[[dict[str, np.ndarray]], np.ndarray]

# deepracer-simapp, metrics/constants.py: the labels of the metrics file.
LABELS = {
    "lap_complete": "Lap complete",
    "crashed": "Crashed",
    "off_track": "Off track",
    "immobilized": "Immobilized",
    "in_progress": "In progress",
    "pause": "Pause",
    "reversed": "Reversed",
    "park": "Park",
    "time_up": "Time Up",
    "prepare": "Prepare",
}


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
class Progress:
    """How a race stands while it runs."""

    lap: int
    laps: int
    lap_ms: int
    total_ms: int
    percent: float
    x: float
    y: float
    off_tracks: int
    resets: int
    last_lap_ms: int | None

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class RaceResult:
    """What a race came to. Everything but ``seconds`` is the same on every run."""

    laps: list[LapResult]
    end_reason: str  # "laps_done", "time_up" or "resets_used"
    simulated_ms: int
    steps: int
    trace: Trace
    engine: str
    versions: dict[str, str]
    seconds: dict[str, float] = field(compare=False)  # of wall time in physics, camera, policy, other: a diagnostic


def run_race(
    track: TrackGeometry,
    rules: RaceRules,
    action_space: ActionSpace,
    sensors: Sequence[str],
    policy: Policy,
    on_progress: Callable[[Progress], None] | None = None,
    progress_every_steps: int = 15,
    *,
    theme: Theme = OFFICIAL,
    physics: CarPhysics = PADDOCK_CAR,
    start_m: float = 0.0,
) -> RaceResult:
    """Race one car and return its result.

    ``policy`` gets a dict of sensor readings and returns the network's output; it may raise, and the race is then over
    without a result. ``on_progress`` is told every ``progress_every_steps`` control steps and at the end. ``start_m``
    moves start and finish along the track.
    """
    begun = perf_counter()
    camera_s = policy_s = 0.0
    with Stage(Ground(track, rules.direction, theme), rules, physics) as stage:
        car = stage.add(sensors, start_m)
        referee = car.referee
        while not car.done:
            if car.pausing:
                stage.step((None,))
            else:
                looked = perf_counter()
                readings = car.observe()
                asked = perf_counter()
                output = policy(readings)
                answered = perf_counter()
                camera_s += asked - looked
                policy_s += answered - asked
                stage.step((action_space.decode(output, referee.step + 1),))
            if on_progress is not None and referee.step % progress_every_steps == 0 and not car.done:
                on_progress(progress_of(car))
        if on_progress is not None:
            on_progress(progress_of(car))
        physics_s = stage.world.seconds
        trace = car.trace()
    total_s = perf_counter() - begun
    return RaceResult(
        laps=lap_results(car),
        end_reason=referee.end_reason or "",
        simulated_ms=referee.time_ms,
        steps=referee.step,
        trace=trace,
        engine=ENGINE_ID,
        versions=versions(),
        seconds={
            "physics": physics_s,
            "camera": camera_s,
            "policy": policy_s,
            "other": total_s - physics_s - camera_s - policy_s,
        },
    )


def lap_results(car: Contestant) -> list[LapResult]:
    """The laps driven so far, the unfinished one last."""
    return [_lap_result(lap, car) for lap in car.referee.laps]


def _lap_result(lap: Lap, car: Contestant) -> LapResult:
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


def progress_of(car: Contestant) -> Progress:
    """The state of a running race for those who watch."""
    referee = car.referee
    lap = referee.lap
    finished = [done for done in referee.laps if done.end_ms is not None]
    x, y = referee.pose.ahead(car.car.physics.nose_x)
    return Progress(
        lap=lap.number,
        laps=referee.rules.laps,
        lap_ms=(lap.end_ms or referee.time_ms) - lap.start_ms,
        total_ms=referee.time_ms,
        percent=round(referee.percent, 2),
        x=round(x, 3),
        y=round(y, 3),
        off_tracks=sum(done.off_tracks for done in referee.laps),
        resets=referee.resets,
        last_lap_ms=finished[-1].end_ms - finished[-1].start_ms if finished else None,
    )
