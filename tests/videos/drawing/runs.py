"""Runs that nobody drove: a car on the centre line of the oval, as a sim-trace with its laps."""

from __future__ import annotations

import math
from typing import Any

from paddock.geometry.catalogue import CATALOGUE
from paddock.simulator.physics import PADDOCK_CAR
from paddock.simulator.trace import CRASHED, IN_PROGRESS, PAUSE, Row, Trace
from videos.drawing import Form, VideoCar, VideoScene

OVAL = next(track for track in CATALOGUE if track.slug == "oval").geometry()
SMALL = Form(640, 360, 30)
STEP_S = 1 / 15


def row(step: int, x: float, y: float, yaw: float, done: float, status: str = IN_PROGRESS, **more: Any) -> Row:
    """A row of a car whose middle is at x, y (m); yaw in radians, ``done`` laps with a share."""
    values = {
        "episode": int(done),
        "steps": float(step + 1),
        "X": x + PADDOCK_CAR.nose_x * math.cos(yaw),
        "Y": y + PADDOCK_CAR.nose_x * math.sin(yaw),
        "yaw": math.degrees(yaw),
        "steer": 0.0,
        "throttle": 0.0 if status == PAUSE else 2.0,
        "action": 0,
        "reward": 0.0,
        "done": False,
        "all_wheels_on_track": True,
        "progress": 100.0 * (done - int(done)),
        "closest_waypoint": 0,
        "track_len": OVAL.length,
        "tstamp": step * STEP_S,
        "episode_status": status,
        "pause_duration": 0.0,
        "obstacle_crash_counter": 0,
        "wall_clock": step * STEP_S,
    }
    return Row(**(values | more))


def driven(seconds: float, speed: float = 2.0, start_m: float = 0.0, offset: float = 0.0) -> list[Row]:
    """Rows of a car that drives along the centre line, ``offset`` m to the left of it."""
    rows = []
    for step in range(round(seconds / STEP_S) + 1):
        metres = start_m + step * STEP_S * speed
        x, y, yaw = OVAL.point_at(metres, offset)
        rows.append(row(step, x, y, yaw, metres / OVAL.length))
    return rows


def with_reset(rows: list[Row], at: int, back_m: float, pause_s: float) -> list[Row]:
    """The rows, but at row ``at`` the car crashes, is put back by ``back_m`` and stands for ``pause_s``."""
    before, crash = rows[:at], rows[at]._replace(episode_status=CRASHED)
    metres = (crash.progress / 100.0 + crash.episode) * OVAL.length - back_m
    x, y, yaw = OVAL.point_at(metres)
    steps = round(pause_s / STEP_S)
    stood = [
        row(at + 1 + k, x, y, yaw, metres / OVAL.length, PAUSE, pause_duration=(steps - k) * STEP_S)
        for k in range(steps)
    ]
    return [*before, crash, *stood]


def lap(number: int, start_ms: int, time_ms: int, complete: bool = True, **more: Any) -> dict[str, Any]:
    """A lap as in ``Result.laps``, its sectors a third each."""
    third = time_ms // 3
    sectors = [third, third, time_ms - 2 * third] if complete else []
    return {
        "number": number,
        "start_ms": start_ms,
        "time_ms": time_ms,
        "complete": complete,
        "off_tracks": 0,
        "crashes": 0,
        "resets": 0,
        "sector_ms": sectors,
        **more,
    }


def car(rows: list[Row] | None = None, number: int = 0, **more: Any) -> VideoCar:
    """A car that drove the rows, two seconds of the oval without."""
    rows = driven(2.0) if rows is None else rows
    values = {"name": f"racer-{number}", "laps": [lap(1, 0, 2000)]} | more
    return VideoCar(number, trace=Trace.of(rows).to_csv(), **values)


def scene(*cars: VideoCar, **more: Any) -> VideoScene:
    """The cars on the oval."""
    values = {"title": "A race", "subtitle": "Oval"} | more
    return VideoScene(OVAL, cars=cars or (car(),), **values)
