"""The place of every car and of the picture's middle in every frame, from sim-traces."""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import gaussian_filter1d

from paddock.geometry.track import TrackGeometry
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.trace import CRASHED, IMMOBILIZED, OFF_TRACK, PAUSE, REVERSED
from tracks.drawing.maps import JUMP_M, TOP_SPEED_MPS

FAULTS = (CRASHED, OFF_TRACK, IMMOBILIZED, REVERSED)
_NUMBERS = ("X", "Y", "yaw", "steer", "throttle", "tstamp")
_FAR_M = 1e5  # no point of a track lies so far away
_LATE_MS = 1e8
_LONGEST_FIELD = 1000

_AHEAD_S = 0.35  # the picture's middle is the car's place so much later,
_SMOOTH_S = 0.42  # smoothed by so many seconds of standard deviation
_BESIDE = (0.27, 0.2)  # greatest distance of the car from the middle, as a share of the picture's width and height
_GLIDE_M = 1.6  # the longest reset over which the picture glides
_AROUND_M = 0.6  # of a picture of the whole track


@dataclass(frozen=True)
class Steps:
    """The readable rows of a trace: ``t`` in ms from the first row, ``x``, ``y`` of the car's middle (m), ``yaw`` (rad,
    unwrapped), ``steer`` (rad), ``speed`` (m/s), ``done`` (laps driven), ``wait`` (s until a pause ends), and
    ``piece``: a number that changes with every reset."""

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray
    steer: np.ndarray
    speed: np.ndarray
    done: np.ndarray
    wait: np.ndarray
    status: np.ndarray
    piece: np.ndarray

    def __len__(self) -> int:
        return len(self.t)


def fault_times(steps: Steps) -> np.ndarray:
    """The times of the car's faults, ms."""
    return steps.t[np.isin(steps.status, FAULTS)]


def read_steps(trace: bytes) -> Steps:
    """The steps of a sim-trace, without rows that cannot be read, lie too far away or go back in time."""
    rows: list[tuple[float, ...]] = []
    words: list[str] = []
    first = None
    for row in _rows(trace):
        numbers = [_number(row.get(name)) for name in _NUMBERS]
        if not all(map(math.isfinite, numbers)) or max(map(abs, numbers[:2])) > _FAR_M:
            continue
        stamp = numbers[5]
        first = stamp if first is None else first
        time = 1000.0 * (stamp - first)
        if not (rows[-1][5] < time < _LATE_MS if rows else time < _LATE_MS):
            continue
        extra = [_number(row.get(name)) for name in ("progress", "episode", "pause_duration")]
        rows.append((*numbers[:5], time, *(value if math.isfinite(value) else 0.0 for value in extra)))
        words.append(str(row.get("episode_status")))
    x, y, degrees, steer, _, t, progress, episode, wait = np.array(rows, np.float64).reshape(-1, 9).T
    yaw = np.unwrap(np.radians(np.fmod(degrees, 360.0)))
    # X and Y are the nose, a shell is drawn around the car's middle.
    x, y = x - PADDOCK_CAR.nose_x * np.cos(yaw), y - PADDOCK_CAR.nose_x * np.sin(yaw)
    status = np.array(words, dtype=str)
    piece = np.zeros(len(t), np.int64)
    apart = np.hypot(np.diff(x), np.diff(y))
    stood = status == PAUSE
    cut = (apart > JUMP_M) | (stood[1:] & ~stood[:-1])
    piece[1:] = np.cumsum(cut)
    done = np.maximum.accumulate(episode + np.clip(progress, 0.0, 100.0) / 100.0) if len(t) else t
    steering = np.radians(np.clip(steer, -PADDOCK_CAR.max_steering_deg, PADDOCK_CAR.max_steering_deg))
    return Steps(t, x, y, yaw, steering, _speeds(t, apart, cut), done, wait, status, piece)


def _rows(trace: bytes) -> Iterator[dict[str, str]]:
    lines = io.StringIO(trace.decode(errors="replace").replace("\0", ""))
    reader = csv.DictReader((line[: 20 * _LONGEST_FIELD] for line in lines), restkey="rest")
    while True:
        try:
            yield next(reader)
        except StopIteration:
            return
        except csv.Error:
            continue


def _number(text: object) -> float:
    try:
        return float(text)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return math.nan


def _speeds(t: np.ndarray, apart: np.ndarray, cut: np.ndarray) -> np.ndarray:
    """Speed (m/s), (n,), from the ways before and after each row."""
    if len(t) < 2:
        return np.zeros(len(t))
    ways = np.where(cut, 0.0, apart) / np.maximum(np.diff(t), 1.0) * 1000.0
    both = np.concatenate((ways[:1], (ways[:-1] + ways[1:]) / 2.0, ways[-1:]))
    return np.clip(both, 0.0, 1.5 * TOP_SPEED_MPS)


@dataclass(frozen=True)
class Motion:
    """A car in every frame. ``gone``: its run is over; ``fault``: the status for which it stands, or ""; ``row``: of
    the trace."""

    x: np.ndarray
    y: np.ndarray
    yaw: np.ndarray
    steer: np.ndarray
    speed: np.ndarray
    done: np.ndarray
    wait: np.ndarray
    standing: np.ndarray
    gone: np.ndarray
    fault: np.ndarray
    row: np.ndarray


def drive_of(steps: Steps, times: np.ndarray) -> Motion:
    """The car at the moments ``times`` (ms, ascending), interpolated between rows of one piece."""
    row = np.clip(np.searchsorted(steps.t, times, side="right") - 1, 0, len(steps) - 1)
    columns = {name: np.empty(len(times)) for name in ("x", "y", "yaw", "steer", "speed")}
    for piece, frames in _runs(steps.piece[row]):
        rows = slice(*np.searchsorted(steps.piece, (piece, piece + 1)).tolist())
        at = np.clip(times[frames], steps.t[rows][0], steps.t[rows][-1])
        for name, column in columns.items():
            column[frames] = _between(steps.t[rows], getattr(steps, name)[rows], at, smooth=name in ("x", "y", "yaw"))
    standing = steps.status[row] == PAUSE
    wait = np.where(standing, np.maximum(steps.wait[row] - (times - steps.t[row]) / 1000.0, 0.0), 0.0)
    gone = times > steps.t[-1]
    for name in ("speed", "steer"):
        columns[name][standing | gone] = 0.0
    done = np.interp(times, steps.t, steps.done)
    return Motion(**columns, done=done, wait=wait, standing=standing, gone=gone, fault=_faults(steps)[row], row=row)


def _runs(numbers: np.ndarray) -> Iterator[tuple[int, slice]]:
    """(number, its slice) for every number of an ascending array."""
    starts = np.concatenate(([0], np.flatnonzero(np.diff(numbers)) + 1, [len(numbers)])).tolist()
    for start, end in pairwise(starts):
        yield int(numbers[start]), slice(start, end)


def _between(t: np.ndarray, values: np.ndarray, at: np.ndarray, *, smooth: bool) -> np.ndarray:
    if smooth and len(t) > 3:
        return Akima1DInterpolator(t, values, method="makima")(at)
    return np.interp(at, t, values)


def _faults(steps: Steps) -> np.ndarray:
    """For each row the fault for which the car stands, or ""."""
    faults = np.full(len(steps), "", dtype=f"<U{max(map(len, FAULTS))}")
    last = ""
    for index, status in enumerate(steps.status.tolist()):
        if status in FAULTS:
            last = status
        elif status != PAUSE:
            last = ""
        faults[index] = last if status == PAUSE else ""
    return faults


def poses_at(steps: Steps, times: np.ndarray, places: Sequence[Sequence[float]]) -> np.ndarray:
    """(n, 3) x, y, yaw of a bot at the moments; ``places`` has a pose for each row of ``steps``, or is empty."""
    table = np.array([place[:3] for place in places if len(place) >= 3], np.float64).reshape(-1, 3)[: len(steps)]
    fine = np.isfinite(table).all(axis=1) & (np.abs(table[:, :2]) < _FAR_M).all(axis=1)
    t, table = steps.t[: len(table)][fine], table[fine]
    if not len(table):
        return np.empty((0, 3))
    table[:, 2] = np.unwrap(table[:, 2])
    return np.column_stack([np.interp(times, t, column) for column in table.T])


@dataclass(frozen=True)
class Eye:
    """The middle of a picture from above in every frame (m), and its zoom (1: usual)."""

    x: np.ndarray
    y: np.ndarray
    zoom: np.ndarray


def eye_of(
    camera: str, steps: Steps, times: np.ndarray, fps: float, view_m: tuple[float, float], track: TrackGeometry
) -> Eye:
    """The picture's way by a camera. ``view_m``: width and height of the visible ground."""
    if camera == "top":
        x_min, y_min, x_max, y_max = track.bounds
        zoom = min(view_m[0] / (x_max - x_min + _AROUND_M), view_m[1] / (y_max - y_min + _AROUND_M))
        still = np.ones(len(times))
        return Eye(still * (x_min + x_max) / 2, still * (y_min + y_max) / 2, still * zoom)
    return follow(steps, times, fps, view_m)


def follow(steps: Steps, times: np.ndarray, fps: float, view_m: tuple[float, float]) -> Eye:
    """The picture's way: the car's, a little ahead and smoothed. It glides over a short reset and is cut at a long one.
    ``view_m``: width and height of the visible ground."""
    frame_ms = 1000.0 / fps
    path = np.arange(times[0] - 3000.0, times[-1] + 3000.0, frame_ms)
    drive = drive_of(steps, path)
    jump = np.hypot(np.diff(drive.x), np.diff(drive.y)) > _GLIDE_M
    scene = np.concatenate(([0], np.cumsum(jump)))
    sigma = _SMOOTH_S * fps
    ahead = round(_AHEAD_S * fps)
    x, y, zoom = np.empty_like(path), np.empty_like(path), np.empty_like(path)
    for _, part in _runs(scene):
        count = part.stop - part.start
        later = np.minimum(np.arange(count) + ahead, count - 1)
        for column, out, width in (
            (drive.x[part][later], x, sigma),
            (drive.y[part][later], y, sigma),
            (1.06 - 0.14 * np.clip(drive.speed[part] / TOP_SPEED_MPS, 0.0, 1.0), zoom, 2.5 * sigma),
        ):
            out[part] = gaussian_filter1d(column, width, mode="nearest")
        for out, column, most in ((x, drive.x, _BESIDE[0] * view_m[0]), (y, drive.y, _BESIDE[1] * view_m[1])):
            # The picture glides over resets too: the distance to the car is smoothed.
            near = gaussian_filter1d(column[part], 0.25 * sigma, mode="nearest")
            out[part] = near + most * np.tanh((out[part] - near) / most)
    at = np.clip(np.round((times - path[0]) / frame_ms).astype(int), 0, len(path) - 1)
    return Eye(x[at], y[at], zoom[at])
