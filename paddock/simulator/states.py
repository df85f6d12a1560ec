"""What is written down of a car in each control step, and the trace that becomes of it at the end of a run.

Four fifths of a row follow from the rest: they are reckoned here, for all rows at once, by the same sums in the same
order as for each alone, and so come to the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from paddock.geometry.track import TrackGeometry

from .clock import STEP_MS
from .trace import COLUMNS, PAUSE, Row, Trace, column

_DEGREES = 180.0 / math.pi  # of math.degrees


class StepState(NamedTuple):
    """A car before a step's action acts. Metres, radians, degrees for the steering, m/s."""

    lap: int  # from 1
    lap_steps: int  # from 1
    x: float  # of the nose
    y: float
    yaw: float
    steering_deg: float
    speed_mps: float
    index: int  # type: ignore[assignment]  # of the action, -1 for none; nobody asks a tuple's own
    reward: float
    ends: bool  # its run or its lap
    all_wheels_on_track: bool
    metres: float  # of the odometer
    has_finished: bool  # the lap
    distance: float  # along the track
    segment: int
    step: int
    status: str
    pause_steps: int
    crashes: int


# Many of them, as cruise.c writes them down.
STATES = np.dtype(
    {
        "names": list(StepState._fields),
        "formats": [
            *("<i8", "<i8", "<f8", "<f8", "<f8", "<f8", "<f8", "<i8", "<f8"),
            *("?", "?", "<f8", "?", "<f8", "<i8", "<i8", "<U12", "<i8", "<i8"),
        ],
        "offsets": [0, 8, 16, 24, 32, 40, 48, 56, 64, 72, 73, 80, 74, 88, 96, 104, 112, 160, 168],
        "itemsize": 176,
    }
)


def trace_of(states: Sequence[tuple | np.ndarray], track: TrackGeometry, start_m: float) -> Trace:
    """The trace of a run whose laps begin ``start_m`` metres after the finish line of ``track``. ``states``: tuples of
    the fields of :class:`StepState`, or arrays of :data:`STATES` that stand for many of them."""
    if not states:
        return Trace.of([])
    told = _by_field(states)
    laps, steps = np.array(told["lap"], np.int64), np.array(told["step"], np.float64)
    length, seconds, status = track.length, steps * STEP_MS / 1000.0, told["status"]
    metres = np.array(told["metres"]) - (start_m + (laps - 1) * length)
    pauses = np.array(told["pause_steps"], np.float64) * STEP_MS / 1000.0
    paused = column("episode_status", status) == PAUSE
    values: dict[str, ArrayLike] = {
        "episode": laps - 1,
        "steps": told["lap_steps"],
        "X": told["x"],
        "Y": told["y"],
        "yaw": np.array(told["yaw"]) * _DEGREES,
        "steer": told["steering_deg"],
        "throttle": told["speed_mps"],
        "action": told["index"],
        "reward": told["reward"],
        "done": told["ends"],
        "all_wheels_on_track": told["all_wheels_on_track"],
        "progress": np.where(told["has_finished"], 100.0, np.minimum(100.0, 100.0 * metres / length)),
        "closest_waypoint": _waypoints(track, np.array(told["distance"]), np.array(told["segment"], np.int64)),
        "track_len": np.full(len(laps), length),
        "tstamp": seconds,
        "episode_status": status,
        "pause_duration": np.where(paused, pauses, 0.0),
        "obstacle_crash_counter": told["crashes"],
        "wall_clock": seconds,
    }
    return Trace({name: column(name, values[name]) for name in COLUMNS})


def _by_field(states: Sequence[tuple | np.ndarray]) -> dict[str, Any]:
    """The values of each field, in the order of the steps."""
    if not any(type(each) is np.ndarray for each in states):
        return dict(zip(StepState._fields, zip(*states, strict=True), strict=True))
    parts: list[np.ndarray] = []
    single: list[tuple] = []
    for each in states:
        if isinstance(each, np.ndarray):
            parts += [np.array(single, STATES), each]
            single = []
        else:
            single.append(each)
    rows = np.concatenate([*parts, np.array(single, STATES)])
    return {name: rows[name] for name in StepState._fields}


def rows_of(trace: Trace) -> list[Row]:
    """Its rows."""
    return [Row(*values) for values in zip(*(trace[name].tolist() for name in COLUMNS), strict=True)]


def _waypoints(track: TrackGeometry, distance: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """The nearer end of each segment."""
    starts, last = track.cumulative, len(track.cumulative) - 1
    after = np.where(segment < last, segment + 1, 0)
    ends = np.where(segment < last, starts[after], track.length)
    return np.where(ends - distance < distance - starts[segment], after, segment)
