"""The reference lap of a track: the racing line, driven in the simulator by a driver with the line in front of it."""

# The driver is an ordinary entrant: it reads its pose, answers steering and speed, and the referee times it. It knows
# the car's response to its commands. How near to the limit a track can be driven, a small search finds, always the same
# one.

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.rules.race import UNTIL_THE_FIRST_FAULT, RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.physics import PADDOCK_CAR, CarPhysics
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.referee import LAPS_DONE
from paddock.simulator.response import Response
from paddock.simulator.results import RaceResult
from paddock.simulator.sensors import POSE
from paddock.simulator.stage import PreparedTrack

from .racing_line import RacingLine, best_line

LAPS = 3
RULES = RaceRules(laps=LAPS, max_simulated_ms=1_200_000, **UNTIL_THE_FIRST_FAULT)
CAR_SPACE = ActionSpace.continuous(
    (-PADDOCK_CAR.max_steering_deg, PADDOCK_CAR.max_steering_deg), (PADDOCK_CAR.min_speed, PADDOCK_CAR.max_speed)
)
_FINE_M = 0.02  # between the points of a planned line
_SMOOTH_M = 0.15
_STEEPEST = 0.9  # share of the curve limit, above which more steering helps little
_FARTHEST_M = 0.35  # more than this beside the line counts as this much
_AWAY_M = 1.5  # so far from its last place on the line, the car was put elsewhere
_LOOK_M = [step * _FINE_M for step in range(-15, 50)]  # for the next place, around the last
_CRAWL_MPS = 0.3  # slower counts as this
_AT_ONCE = 1e6  # m/s^2
_SETTLED_M = 1e-4


Row = tuple[float, float, float, float, float, float]  # x, y, heading, curvature, its change by the way, speed


@dataclass(frozen=True)
class DrivingStyle:
    """How a lap is driven. ``shortness``, ``margin``: of the line (:func:`.racing_line.best_line`), margin in metres;
    ``grip``: share of the curve limit; ``braking``: share of the car's; ``settle_m``, ``settle_s``: the way in which an
    error falls to a third, at rest and for each m/s; ``early_s``: by how much a speed is commanded before its place."""

    shortness: float = 0.1
    margin: float = 0.09
    grip: float = 0.9
    braking: float = 0.6
    settle_m: float = 0.1
    settle_s: float = 0.14
    early_s: float = 0.08


# What the search tries, one group after the other, each with the best of the others.
CHOICES: tuple[tuple[dict[str, float], ...], ...] = (
    tuple({"grip": grip} for grip in (0.8, 0.95, 1.0)),
    tuple({"shortness": short, "margin": far} for short in (0.03, 0.1, 0.3, 1.0) for far in (0.09, 0.06, 0.03, 0.0)),
    tuple({"settle_s": settle} for settle in (0.1, 0.2, 0.28)),
    tuple({"early_s": early} for early in (0.06, 0.1)),
    tuple({"braking": braking} for braking in (0.4, 0.8)),
)
# For roads on which the first is too fast: slower and slower.
CAREFUL = (
    DrivingStyle(),
    *(DrivingStyle(grip=grip, braking=0.3, margin=0.12, settle_m=0.06) for grip in (0.75, 0.6, 0.45, 0.3)),
)


@dataclass(frozen=True)
class ReferenceRun:
    """The fastest run found: its style and result, and how many runs it is the best of."""

    style: DrivingStyle
    result: RaceResult
    runs: int

    @property
    def time_ms(self) -> int:
        """The best lap."""
        return min(lap.time_ms for lap in self.result.laps)


def drive_reference(track: TrackGeometry, direction: str) -> ReferenceRun | None:
    """The best of the runs of three laps that the search drives, always the same ones on a machine; None where the
    driver cannot stay on the road."""
    ground = PreparedTrack(track, direction)
    lines: dict[tuple[float, float], RacingLine] = {}
    found: dict[DrivingStyle, RaceResult | None] = {}

    def drive(style: DrivingStyle) -> float:
        """The best lap of a run without a fault."""
        if style not in found:
            key = style.shortness, style.margin
            if key not in lines:
                lines[key] = best_line(ground.track, style.margin, style.shortness, settled_m=_SETTLED_M)
            found[style] = result = drive_line(ground, lines[key], style)
        result = found[style]
        return math.inf if result is None else min(lap.time_ms for lap in result.laps)

    best = next((style for style in CAREFUL if drive(style) < math.inf), None)
    if best is None:
        return None
    before = None
    while best != before:
        before = best
        for changes in CHOICES:
            best = min((best, *(replace(best, **change) for change in changes)), key=drive)
    result = found[best]
    assert result is not None
    return ReferenceRun(best, result, len(found))


def drive_line(ground: PreparedTrack, line: RacingLine, style: DrivingStyle) -> RaceResult | None:
    """A run of three laps along a line; None after a fault."""
    driver = LineDriver(line, style)
    rules = replace(RULES, direction=ground.track.direction)
    entrant = Entrant(driver.action_space, driver.sensors, driver)
    result = run_race(RaceSettings(ground.track, rules, [entrant], ground=ground))
    return result if result.end_reason == LAPS_DONE and not any(lap.resets for lap in result.laps) else None


class LineDriver:
    """Drives a line as fast as a style allows; one for each run. Call it with the readings of ``sensors``."""

    sensors = (POSE,)
    action_space = CAR_SPACE

    def __init__(self, line: RacingLine, style: DrivingStyle, physics: CarPhysics = PADDOCK_CAR) -> None:
        self._style, self._physics = style, physics
        self._closed = not line.is_open
        self._step_m, self._rows = _plan(line, style, physics)
        self._at: int | None = None
        self._response = Response(physics)  # of the car, to the same commands

    def __call__(self, readings: dict[str, np.ndarray]) -> list[float]:
        """Two values in [-1, 1] from ``readings["POSE"]``: x, y (m), yaw (rad), speed (m/s)."""
        physics, style, rows = self._physics, self._style, self._rows
        x, y, yaw, _ = readings[POSE].tolist()
        if self._at is not None and math.dist(rows[self._at][:2], (x, y)) > _AWAY_M:
            self._at, self._response = None, Response(physics)
        # the middle of the rear axle, which goes where the car points to, when the command begins to act
        later = self._response.copy()
        x += physics.rear_axle_x * math.cos(yaw)
        y += physics.rear_axle_x * math.sin(yaw)
        for _ in range(physics.steering_dead_ticks):
            later.advance(1)
            yaw += later.curvature * later.speed / physics.tick_hz
            x += later.speed * math.cos(yaw) / physics.tick_hz
            y += later.speed * math.sin(yaw) / physics.tick_hz
        self._at = at = self._nearest(x, y)
        speed, curvature = max(later.speed, _CRAWL_MPS), later.curvature

        line_x, line_y, heading, bend, *_ = rows[at]
        aside = (y - line_y) * math.cos(heading) - (x - line_x) * math.sin(heading)
        aside = min(max(aside, -_FARTHEST_M), _FARTHEST_M)
        turned = math.sin(yaw - heading)
        # Along the way aside''' is the change of the curvature: with it as below, all three errors fall with one pole.
        # The command holds for a step, in which the curvature comes nearer to it: aim so far beyond that it is right at
        # the end, with the slope of the grip's cut-off. The line is looked up in the middle of that step.
        hold_m = speed * physics.ticks_per_step / physics.tick_hz
        lead_m = hold_m / -math.expm1(-hold_m / (physics.steering_lag_s_per_mps * speed * speed))
        pole = 1.0 / (style.settle_m + style.settle_s * speed)
        change = rows[self._row(at, hold_m / 2)][4]
        change -= pole * (3 * (curvature - bend) + pole * (3 * turned + pole * aside))
        demand = later.demand + lead_m * change * self._slope(curvature, speed)

        angle = math.degrees(math.atan(demand * physics.effective_wheelbase))
        pace = rows[self._row(at, speed * style.early_s)][5] / physics.speed_gain
        span = physics.max_speed - physics.min_speed
        values = (angle / physics.max_steering_deg, 2.0 * (pace - physics.min_speed) / span - 1.0)
        output = [min(max(value, -1.0), 1.0) for value in values]
        command = self.action_space.decode(output)
        self._response.command(command.steering_deg, command.speed_mps)
        self._response.advance(physics.ticks_per_step)
        return output

    def _row(self, at: int, ahead_m: float) -> int:
        """The row so far ahead of another, at most the last of an open line."""
        row = at + round(ahead_m / self._step_m)
        return row % len(self._rows) if self._closed else min(max(row, 0), len(self._rows) - 1)

    def _nearest(self, x: float, y: float) -> int:
        """The row nearest to a place: at the start of all, then of those around the last."""
        last = self._at
        near = range(len(self._rows)) if last is None else [self._row(last, ahead) for ahead in _LOOK_M]
        return min(near, key=lambda row: (self._rows[row][0] - x) ** 2 + (self._rows[row][1] - y) ** 2)

    def _slope(self, curvature: float, speed: float) -> float:
        """Of the demand by the curvature, which grows without end towards the limit."""
        physics = self._physics
        limit = physics.curvature_limit / (1.0 + physics.curvature_limit_falloff * speed * speed)
        sharpness = physics.curvature_limit_sharpness
        return (1.0 - min(abs(curvature) / limit, _STEEPEST) ** sharpness) ** (-1.0 - 1.0 / sharpness)


def _plan(line: RacingLine, style: DrivingStyle, physics: CarPhysics) -> tuple[float, list[Row]]:
    """The rows of a line, and the equal step between them in metres."""
    # the car speeds up as it can: commands need not wait for it
    brakes = replace(physics, braking=physics.braking * style.braking, acceleration=_AT_ONCE)
    speeds = line.speeds(physics.max_speed, brakes, style.grip)
    if line.is_open:
        speeds[0] = speeds[1]
    columns = [*line.points.T, line.curvatures, speeds]
    places = np.concatenate(([0.0], np.cumsum(line.steps)))
    if line.is_open:
        places = places[:-1]
    else:
        columns = [np.append(column, column[0]) for column in columns]
    count = round(places[-1] / _FINE_M)
    step = float(places[-1]) / count
    x, y, curvature, speed = (np.interp(np.arange(count) * step, places, column) for column in columns)
    ends = "edge" if line.is_open else "wrap"
    curvature = _smooth(curvature, round(_SMOOTH_M / step), ends)
    heading = np.arctan2(_change(y, ends), _change(x, ends))
    change = _change(curvature, ends) / step
    return step, list(zip(*(column.tolist() for column in (x, y, heading, curvature, change, speed)), strict=True))


def _change(values: np.ndarray, ends: Any) -> np.ndarray:
    """From each of equally spaced values to the next."""
    return np.gradient(np.pad(values, 1, ends))[1:-1]


def _smooth(values: np.ndarray, reach: int, ends: Any) -> np.ndarray:
    weights = np.hanning(2 * reach + 3)[1:-1]
    return np.convolve(np.pad(values, reach, ends), weights / weights.sum(), "valid")
