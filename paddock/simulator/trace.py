"""The trace of a run, one row per control step in the columns of the official sim-trace (version 6), and its states."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from paddock.geometry.track import TrackGeometry

from .physics import STEP_MS

# deepracer-simapp 6, metrics: episode_status labels of the trace.
IN_PROGRESS, PREPARE, PAUSE = "in_progress", "prepare", "pause"
LAP_COMPLETE, OFF_TRACK, CRASHED = "lap_complete", "off_track", "crashed"
IMMOBILIZED, REVERSED, TIME_UP, PARK = "immobilized", "reversed", "time_up", "park"
STATUSES = (IN_PROGRESS, PREPARE, PAUSE, LAP_COMPLETE, OFF_TRACK, CRASHED, IMMOBILIZED, REVERSED, TIME_UP, PARK)

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


class Row(NamedTuple):
    """One control step: the state before the step's action acts. X and Y are the nose, yaw and steer in degrees."""

    episode: int
    steps: float
    X: float
    Y: float
    yaw: float
    steer: float
    throttle: float
    action: int
    reward: float
    done: bool
    all_wheels_on_track: bool
    progress: float
    closest_waypoint: int
    track_len: float
    tstamp: float
    episode_status: str
    pause_duration: float
    obstacle_crash_counter: int
    wall_clock: float  # the simulated time again: nothing in a trace depends on the host


COLUMNS = Row._fields
_DTYPES = {int: "<i8", float: "<f8", bool: "|b1", str: f"<U{max(map(len, STATUSES))}"}
_TYPES = get_type_hints(Row)


def column(name: str, values: ArrayLike) -> np.ndarray:
    """The values of a column, as a trace holds them."""
    return np.asarray(values, dtype=_DTYPES[_TYPES[name]])


@dataclass(frozen=True)
class Trace:
    """All rows of a run, one numpy array a column."""

    columns: dict[str, np.ndarray]

    @classmethod
    def of(cls, rows: list[Row]) -> Trace:
        turned = list(zip(*rows, strict=True)) if rows else [()] * len(COLUMNS)
        return cls({name: column(name, values) for name, values in zip(COLUMNS, turned, strict=True)})

    def __len__(self) -> int:
        return len(self.columns["steps"])

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    @property
    def sha256(self) -> str:
        """sha-256 (hex) over names and little-endian bytes of all columns: equal runs, equal number."""
        digest = hashlib.sha256()
        for name in COLUMNS:
            column = self.columns[name]
            digest.update(f"{name}:{len(column)}:{column.dtype.str};".encode())
            digest.update(np.ascontiguousarray(column).tobytes())
        return digest.hexdigest()

    def to_csv(self) -> bytes:
        """The official file: header and a line a row, floats with all their digits."""
        return (",".join(COLUMNS) + "\n").encode() + csv_rows([self.columns[name] for name in COLUMNS])


def csv_rows(columns: Sequence[np.ndarray]) -> bytes:
    """The rows of ``columns``, which have one length, as lines of CSV text with all digits of each number."""
    # Digits take most of the time, and columns repeat.
    known: dict[tuple[str, bytes], list[str]] = {}
    texts = []
    for column in columns:
        content = column.tobytes()
        key = column.dtype.str, content
        if key not in known:
            values = column.tolist()
            if column.dtype.kind == "U":
                known[key] = values
            elif values and content == content[: column.itemsize] * len(values):
                known[key] = [repr(values[0])] * len(values)
            else:
                known[key] = list(map(repr, values))
        texts.append(known[key])
    return "".join([",".join(row) + "\n" for row in zip(*texts, strict=True)]).encode()


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
    index: int  # type: ignore[assignment]  # of the action, -1 for none
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


# Many of them, in the layout of cruise.c.
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
    """The trace of a run whose laps begin ``start_m`` metres after the finish line. ``states``: tuples of the fields of
    :class:`StepState`, or arrays of :data:`STATES`."""
    if not states:
        return Trace.of([])
    columns = _by_field(states)
    laps, steps = np.array(columns["lap"], np.int64), np.array(columns["step"], np.float64)
    length, seconds, status = track.length, steps * STEP_MS / 1000.0, columns["status"]
    metres = np.array(columns["metres"]) - (start_m + (laps - 1) * length)
    pauses = np.array(columns["pause_steps"], np.float64) * STEP_MS / 1000.0
    paused = column("episode_status", status) == PAUSE
    values: dict[str, ArrayLike] = {
        "episode": laps - 1,
        "steps": columns["lap_steps"],
        "X": columns["x"],
        "Y": columns["y"],
        "yaw": np.array(columns["yaw"]) * _DEGREES,
        "steer": columns["steering_deg"],
        "throttle": columns["speed_mps"],
        "action": columns["index"],
        "reward": columns["reward"],
        "done": columns["ends"],
        "all_wheels_on_track": columns["all_wheels_on_track"],
        "progress": np.where(columns["has_finished"], 100.0, np.minimum(100.0, 100.0 * metres / length)),
        "closest_waypoint": _waypoints(track, np.array(columns["distance"]), np.array(columns["segment"], np.int64)),
        "track_len": np.full(len(laps), length),
        "tstamp": seconds,
        "episode_status": status,
        "pause_duration": np.where(paused, pauses, 0.0),
        "obstacle_crash_counter": columns["crashes"],
        "wall_clock": seconds,
    }
    return Trace({name: column(name, values[name]) for name in COLUMNS})


def _by_field(states: Sequence[tuple | np.ndarray]) -> Mapping[str, ArrayLike]:
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
    return [Row(*values) for values in zip(*(trace[name].tolist() for name in COLUMNS), strict=True)]


def _waypoints(track: TrackGeometry, distance: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """The nearer end of each segment."""
    starts, last = track.cumulative, len(track.cumulative) - 1
    after = np.where(segment < last, segment + 1, 0)
    ends = np.where(segment < last, starts[after], track.length)
    return np.where(ends - distance < distance - starts[segment], after, segment)
