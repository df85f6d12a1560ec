"""A run along its way: commanded and driven speed and steering, offset and curvature, from its sim-trace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paddock.geometry.track import TrackGeometry
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.results import LapDocument
from paddock.simulator.trace import CRASHED, IMMOBILIZED, OFF_TRACK, PAUSE, REVERSED

JUMP_M = 0.6  # between two steps: no car drives so far, it was put back
_CREEP_M = 0.02  # the least way of a step that shows its curvature
_END = 100.0  # percent
GRID_M = 0.1
GRID_POINTS = 600  # at most, of a lap
FAULTS = (OFF_TRACK, CRASHED, IMMOBILIZED, REVERSED)
_PUT_BACK = (PAUSE, *FAULTS)  # where the way to the next step is not driven
CHANNELS = ("speed", "driven_speed", "steer", "driven_steer", "offset", "curvature", "reward")


@dataclass(frozen=True)
class DrivenTrace:
    """The columns of a sim-trace, one element a step, 0 where it has no such column. ``lap``: from 1; ``ms``: of the
    run; ``x``, ``y``: of the nose; ``yaw``: radians; ``steer`` (degrees) and ``speed`` (m/s): commanded;
    ``driven_speed``: of the rear axle; ``curvature``: 1/m of its path, positive to the left; ``driven_steer``: the
    angle that a car without grip limit and lag needs for it."""

    lap: np.ndarray
    ms: np.ndarray
    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray
    steer: np.ndarray
    speed: np.ndarray
    reward: np.ndarray
    percent: np.ndarray
    on_road: np.ndarray
    status: np.ndarray
    driven_speed: np.ndarray
    driven_steer: np.ndarray
    curvature: np.ndarray

    @classmethod
    def of(cls, trace_csv: bytes) -> DrivenTrace:
        header, *lines = trace_csv.decode().splitlines()
        columns = dict(zip(header.split(","), zip(*[line.split(",") for line in lines], strict=True), strict=False))
        zeros = ("0",) * len(lines)

        def numbers(name: str) -> np.ndarray:
            return np.array(columns.get(name, zeros), np.float64)

        x, y, yaw, ms = numbers("X"), numbers("Y"), np.radians(numbers("yaw")), numbers("tstamp") * 1000.0
        status = np.array(columns.get("episode_status", zeros), str)
        driven_speed, curvature = _driven(x, y, yaw, ms, status)
        return cls(
            lap=numbers("episode").astype(int) + 1,
            ms=ms,
            x=x,
            y=y,
            yaw=yaw,
            steer=numbers("steer"),
            speed=numbers("throttle"),
            reward=numbers("reward"),
            percent=np.minimum(numbers("progress"), _END),
            on_road=np.array([text != "False" for text in columns.get("all_wheels_on_track", zeros)], bool),
            status=status,
            driven_speed=driven_speed,
            driven_steer=np.degrees(np.arctan(curvature * PADDOCK_CAR.effective_wheelbase)),
            curvature=curvature,
        )


def _driven(
    x: np.ndarray, y: np.ndarray, yaw: np.ndarray, ms: np.ndarray, status: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Speed and curvature of the rear axle at each step: the mean of the ways to it and from it, as far as it drove."""
    behind = PADDOCK_CAR.nose_x - PADDOCK_CAR.rear_axle_x
    dx, dy = np.diff(x - behind * np.cos(yaw)), np.diff(y - behind * np.sin(yaw))
    metres, seconds = np.hypot(dx, dy), np.diff(ms) / 1000.0
    turned = np.remainder(np.diff(yaw) + np.pi, 2 * np.pi) - np.pi
    drives = (metres < JUMP_M) & (seconds > 0) & ~np.isin(status[:-1], _PUT_BACK)
    moves = drives & (metres > _CREEP_M)
    speed = np.where(drives, metres / np.where(seconds > 0, seconds, 1.0), 0.0)
    return _at_steps(speed, drives), _at_steps(turned / np.where(moves, metres, 1.0), moves)


def _at_steps(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """For each step the mean of the valid values before and after it, 0 without one."""
    weights = valid.astype(np.float64)
    total, count = np.zeros(len(values) + 1), np.zeros(len(values) + 1)
    for part in (slice(1, None), slice(None, -1)):
        total[part] += values * weights
        count[part] += weights
    return total / np.maximum(count, 1.0)


@dataclass(frozen=True)
class LapLine:
    """A lap by distance: ``percent`` (rising), ``ms`` since its start, ``steps``: the trace's row at each place,
    ``speed``: commanded there, m/s; ``start_ms`` of the run; ``time_ms`` if complete."""

    number: int
    start_ms: int
    time_ms: int | None
    percent: np.ndarray
    ms: np.ndarray
    steps: np.ndarray
    speed: np.ndarray

    @property
    def reached(self) -> float:
        """How far it came, in percent."""
        return float(self.percent[-1])

    def ms_at(self, percent: np.ndarray) -> np.ndarray:
        """Since the lap's start, NaN where it did not come."""
        return np.interp(percent, self.percent, self.ms, right=np.nan)

    def at(self, percent: np.ndarray, values: np.ndarray) -> np.ndarray:
        """A column of the trace at these places, NaN where the lap did not come."""
        return np.interp(percent, self.percent, values[self.steps], right=np.nan)


def lap_line(trace: DrivenTrace, laps: Sequence[LapDocument], number: int) -> LapLine | None:
    """Lap ``number`` (from 1), None for one without steps. At a place passed twice because of a reset the first time
    counts."""
    lap = next((lap for lap in laps if lap["number"] == number), None)
    steps = np.flatnonzero(trace.lap == number)
    if len(steps):
        best = np.maximum.accumulate(trace.percent[steps])
        steps = steps[(trace.percent[steps] > 0.0) & np.diff(best, prepend=0.0).astype(bool)]
    if lap is None or not len(steps):
        return None
    percent = trace.percent[steps]
    ms = np.maximum.accumulate(np.maximum(trace.ms[steps] - lap["start_ms"], 0.0))
    time_ms = lap["time_ms"] if lap["complete"] else None
    last = steps[-1:]
    if time_ms is not None:
        if percent[-1] >= _END:  # the row behind the line: the time at the line is known better
            percent, ms, steps = percent[:-1], ms[:-1], steps[:-1]
        percent, ms = np.append(percent, _END), np.append(np.minimum(ms, time_ms), time_ms)
        steps = np.append(steps, last)
    first = steps[:1] if len(steps) else last
    percent, ms, steps = (np.append(*each) for each in ((0.0, percent), (0.0, ms), (first, steps)))
    return LapLine(number, lap["start_ms"], time_ms, percent, ms, steps, trace.speed[steps])


def start_of(trace: DrivenTrace, track: TrackGeometry) -> float:
    """Metres from the track's finish to the line at which the laps of a run begin; ``track`` in the driven
    direction."""
    if track.is_open or not len(trace.x):
        return 0.0
    metres = track.project(float(trace.x[0]), float(trace.y[0])).distance - trace.percent[0] / _END * track.length
    start = round(float(metres), 2) % track.length
    return 0.0 if min(start, track.length - start) < GRID_M / 2 else start


def grid_of(length_m: float) -> np.ndarray:
    """The metres of a lap at which telemetry is given, both ends among them."""
    return np.linspace(0.0, length_m, min(max(round(length_m / GRID_M), 2), GRID_POINTS) + 1)


@dataclass(frozen=True)
class LapTelemetry:
    """A lap on a grid of ``metres`` from its start, NaN where it did not come. Channels as in :class:`DrivenTrace`;
    ``offset``: metres to the left of the centre line, of the nose; ``reward``: None where the trace has none;
    ``faults``: metres and status of what cost the lap time beyond driving."""

    number: int
    start_ms: int
    time_ms: int | None
    metres: np.ndarray
    ms: np.ndarray
    speed: np.ndarray
    driven_speed: np.ndarray
    steer: np.ndarray
    driven_steer: np.ndarray
    offset: np.ndarray
    curvature: np.ndarray
    reward: np.ndarray | None
    faults: list[tuple[float, str]]

    @property
    def reached_m(self) -> float:
        """How far it came."""
        return float(self.metres[np.flatnonzero(~np.isnan(self.ms))[-1]])


def lap_telemetry(trace: DrivenTrace, line: LapLine, track: TrackGeometry) -> LapTelemetry:
    """A lap's channels along its way; ``track`` in the driven direction."""
    metres = grid_of(track.length)
    percent = np.linspace(0.0, _END, len(metres))
    offsets = np.zeros(len(trace.x))
    hint: int | None = None
    for step in line.steps.tolist():
        place = track.project(float(trace.x[step]), float(trace.y[step]), hint)
        offsets[step], hint = place.offset, place.index
    rows = np.flatnonzero((trace.lap == line.number) & np.isin(trace.status, FAULTS))
    return LapTelemetry(
        number=line.number,
        start_ms=line.start_ms,
        time_ms=line.time_ms,
        metres=metres,
        ms=line.ms_at(percent),
        offset=line.at(percent, offsets),
        reward=line.at(percent, trace.reward) if np.nan_to_num(trace.reward).any() else None,
        faults=[(float(trace.percent[row]) / _END * track.length, str(trace.status[row])) for row in rows.tolist()],
        **{
            name: line.at(percent, getattr(trace, name))
            for name in ("speed", "driven_speed", "steer", "driven_steer", "curvature")
        },
    )


@dataclass(frozen=True)
class Excursion:
    """A stretch with a wheel beyond the border. Metres from the lap's start; ``ms`` since the run's; ``reset``: the
    referee put the car back, or ended the run."""

    lap: int
    from_m: float
    to_m: float
    ms: int
    reset: bool


def excursions(trace: DrivenTrace, length_m: float) -> list[Excursion]:
    """Where a run left the road, in the order in which it did."""
    off = ~trace.on_road & (trace.status != PAUSE)
    edges = np.diff(np.concatenate(([0], off.astype(int), [0])))
    found = []
    for first, after in zip(np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist(), strict=True):
        rows = slice(first, after)
        metres = trace.percent[rows] * (length_m / _END)
        reset = bool(np.isin(trace.status[first : after + 1], (OFF_TRACK, CRASHED)).any())
        found.append(
            Excursion(
                int(trace.lap[first]), float(metres[0]), float(metres.max()), round(float(trace.ms[first])), reset
            )
        )
    return found
