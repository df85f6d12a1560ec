"""Sim-traces as the official simulator writes them (CSV), read as recorded drives."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

from paddock.errors import UserFault

from .car import Pose
from .physics import PADDOCK_CAR, CarPhysics
from .trace import PAUSE, PREPARE

COLUMNS = ("episode", "X", "Y", "yaw", "steer", "throttle", "tstamp", "episode_status")
ON_THE_ROAD = "in_progress"
MAX_BYTES = 64 * 1024 * 1024
MAX_GAP_S = 0.25  # between two rows of a drive; simapp's longest measured step is 0.15 s
MAX_SPEED_MPS = 5.5  # a car that moves faster between two rows was put elsewhere; the fastest command is 4 m/s
FRAME_S = 1.0 / 15.0
MAX_NUMBER = 1e10  # times of day in seconds are a fifth of it; far beyond, a float no longer tells two rows apart
_LONGEST_FIELD = 1000


@dataclass(frozen=True)
class RecordedState:
    """A row: where the base of the car is at a time (s), and the command (degrees to the left, m/s) it gets then."""

    time: float
    pose: Pose  # yaw runs on beyond a half turn, so that headings of one drive can be subtracted
    steering_deg: float
    speed_mps: float


Drive = Sequence[RecordedState]
"""Rows that follow each other without a jump."""


def read_drives(data: bytes, physics: CarPhysics = PADDOCK_CAR) -> list[Drive]:
    """Every stretch that a recorded car drove without being put anywhere.

    Needs the columns of ``COLUMNS``, in any order; others are ignored. X and Y (m) are the nose, yaw is in degrees.
    Preparing and pausing rows are left out; a drive ends with its episode, with its lap, with a fault, with a jump.

    The time stamp of a row is that of the end of its step (in recorded drives the way to the next row goes with the
    difference of the two stamps *before* it, hardly with its own), so a state's time is the stamp of the row before.

    Raises UserFault: ``trace_too_large``, ``trace_not_csv``, ``trace_columns_missing``, ``trace_column_twice``,
    ``trace_not_a_number``, ``trace_number_too_large``, ``trace_out_of_order``.
    """
    if len(data) > MAX_BYTES:
        raise UserFault("trace_too_large", limit_mb=MAX_BYTES // 1024**2)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UserFault("trace_not_csv") from None
    if "\0" in text:
        raise UserFault("trace_not_csv")
    rows = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    drives: list[list[RecordedState]] = []
    drive: list[RecordedState] = []
    episode = stamp = None
    try:
        names = rows.fieldnames or []
        missing = [name for name in COLUMNS if name not in names]
        if missing:
            raise UserFault("trace_columns_missing", columns=", ".join(missing))
        twice = [name for name in COLUMNS if names.count(name) > 1]
        if twice:
            raise UserFault("trace_column_twice", columns=", ".join(twice))
        for row in rows:
            values = {name: _number(row, name, rows.line_num) for name in COLUMNS[1:-1]}
            status = (row["episode_status"] or "").strip()
            if row["episode"] != episode:
                episode, stamp, drive = row["episode"], None, []
            now = values["tstamp"]
            if stamp is not None and now < stamp:
                raise UserFault("trace_out_of_order", row=rows.line_num)
            time = now - FRAME_S if stamp is None else stamp
            stamp = now
            if status in (PREPARE, PAUSE):
                drive = []
                continue
            state = _state(values, time, drive[-1].pose.yaw if drive else None, physics)
            if not drive or _jumped(drive[-1], state):
                drive = []
                drives.append(drive)
            drive.append(state)
            if status != ON_THE_ROAD:
                drive = []
    except csv.Error:
        raise UserFault("trace_not_csv") from None
    return [drive for drive in drives if len(drive) > 1]


def _number(row: dict[str, str | None], name: str, line: int) -> float:
    """A number of at most ``MAX_NUMBER``. Raises UserFault: ``trace_not_a_number``, ``trace_number_too_large``."""
    text = row[name]
    try:
        value = float(text)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        shown = "nothing" if text is None else text[:40]
        raise UserFault("trace_not_a_number", row=line, column=name, value=shown)
    if abs(value) > MAX_NUMBER:
        raise UserFault("trace_number_too_large", row=line, column=name, value=f"{value:g}", limit=f"{MAX_NUMBER:g}")
    return value


def _state(values: dict[str, float], time: float, yaw_before: float | None, physics: CarPhysics) -> RecordedState:
    yaw = math.radians(values["yaw"])
    if yaw_before is not None:
        yaw = yaw_before + math.remainder(yaw - yaw_before, 2.0 * math.pi)
    x, y = Pose(values["X"], values["Y"], yaw).ahead(-physics.nose_x)
    return RecordedState(time, Pose(x, y, yaw), values["steer"], values["throttle"])


def _jumped(before: RecordedState, after: RecordedState) -> bool:
    seconds = after.time - before.time
    apart = math.hypot(after.pose.x - before.pose.x, after.pose.y - before.pose.y)
    return seconds > MAX_GAP_S or apart > MAX_SPEED_MPS * max(seconds, FRAME_S)
