"""The record of a run, a row a control step, in the columns of the official sim-trace (version 6)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import NamedTuple, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from .rows import written

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
    """All rows of a run, one numpy array a column (attribute and key by the column's name)."""

    columns: dict[str, np.ndarray]

    @classmethod
    def of(cls, rows: list[Row]) -> Trace:
        """Columns from rows."""
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
        return (",".join(COLUMNS) + "\n").encode() + written([self.columns[name] for name in COLUMNS])

    def points(self) -> np.ndarray:
        """(n, 2): the trajectory of the nose, for drawing."""
        return np.column_stack((self.columns["X"], self.columns["Y"]))
