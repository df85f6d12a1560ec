"""The documents of the viewer, in metres and degrees of the track's frame: a run with every step of each car, and the
scene with the track."""

import csv
import io
import math
from collections.abc import Sequence
from typing import Any, TypedDict

from evaluation.appearance.looks import VehicleLook
from evaluation.models import Evaluation
from evaluation.running.competitors import CompetitorRow
from evaluation.running.results import read_layout, read_trace
from evaluation.templatetags.looks import shell_from_above
from paddock.analysis.turns import turns_of
from paddock.errors import PlatformFault
from paddock.geometry.checks import Points
from paddock.simulator.layout import BoxDocument
from paddock.simulator.results import LapDocument
from paddock.simulator.solids import box as box_solid
from paddock.simulator.trace import CRASHED, OFF_TRACK
from tracks.models import Track

from .selectors import direction_of

RUN_FORMAT = 1
SCENE_FORMAT = 2
JUMP_M = 0.6  # a car moves less in a step; more is a reset
_INCIDENTS = {OFF_TRACK: "off_track", CRASHED: "crash"}


class RunColumns(TypedDict):
    """A car's steps as columns of equal length: simulated ms since the start, the nose (m), degrees anticlockwise,
    commanded m/s and degrees, the lap from 1, the row's status, percent of the lap, and whether all wheels are on the
    track."""

    t: list[int]
    x: list[float]
    y: list[float]
    yaw: list[float]
    v: list[float]
    steer: list[float]
    lap: list[int]
    status: list[str]
    progress: list[float]
    on_track: list[bool]


class ReplayEvent(TypedDict):
    """Something that happened to a car: lap, off_track, crash or reset."""

    t: int
    kind: str
    car: int


class ReplayLap(TypedDict):
    number: int
    start_ms: int
    time_ms: int
    complete: bool
    sector_ms: list[int]


class ReplayCar(TypedDict):
    number: int
    name: str
    look: dict[str, str]
    laps: list[ReplayLap]
    columns: RunColumns
    events: list[ReplayEvent]


class RunDocument(ReplayCar):
    """A run: its own car with the address and setting of the run, and its rivals. ``events``: of all cars."""

    run: str
    href: str
    engine: str
    track: str
    direction: str
    bots: list[dict[str, list[float]]]
    boxes: list[dict[str, float]]
    rivals: list[ReplayCar]


def trace_columns(trace_csv: bytes) -> RunColumns:
    """The columns of a sim-trace. Raises PlatformFault("file_damaged") for one that cannot be read."""
    try:
        header, *rows = csv.reader(io.StringIO(trace_csv.decode()))
        if not rows:
            return {name: [] for name in RunColumns.__annotations__}  # type: ignore[return-value]
        of = dict(zip(header, zip(*rows, strict=True), strict=True))
        stamps = [float(each) for each in of["tstamp"]]
        return {
            "t": [round((stamp - stamps[0]) * 1000) for stamp in stamps],
            "x": _numbers(of["X"], 4),
            "y": _numbers(of["Y"], 4),
            "yaw": _numbers(of["yaw"], 2),
            "v": _numbers(of["throttle"], 2),
            "steer": _numbers(of["steer"], 1),
            "lap": [int(float(each)) + 1 for each in of["episode"]],
            "status": list(of["episode_status"]),
            "progress": _numbers(of["progress"], 3),
            "on_track": [each == "True" for each in of["all_wheels_on_track"]],
        }
    except (KeyError, ValueError) as fault:
        raise PlatformFault("file_damaged") from fault


def _numbers(column: Sequence[str], digits: int) -> list[float]:
    return [round(float(each), digits) for each in column]


def car_events(number: int, columns: RunColumns, laps: Sequence[LapDocument]) -> list[ReplayEvent]:
    """What happened to car ``number``, in order."""
    found: list[ReplayEvent] = [
        {"t": lap["start_ms"] + lap["time_ms"], "kind": "lap", "car": number} for lap in laps if lap["complete"]
    ]
    t, x, y, status = columns["t"], columns["x"], columns["y"], columns["status"]
    for step in range(1, len(t)):
        kind = _INCIDENTS.get(status[step])
        if kind is not None and status[step] != status[step - 1]:
            found.append({"t": t[step], "kind": kind, "car": number})
        if math.hypot(x[step] - x[step - 1], y[step] - y[step - 1]) > JUMP_M:
            found.append({"t": t[step], "kind": "reset", "car": number})
    return sorted(found, key=lambda event: event["t"])


def lap_documents(laps: Sequence[LapDocument]) -> list[ReplayLap]:
    return [
        {
            "number": lap["number"],
            "start_ms": lap["start_ms"],
            "time_ms": lap["time_ms"],
            "complete": lap["complete"],
            "sector_ms": lap.get("sector_ms") or [],
        }
        for lap in laps
    ]


def look_document(look: VehicleLook) -> dict[str, str]:
    """A look; ``above``: its paths from above as SVG, the middle at 0, driving to the right, 2 units long."""
    return {"shell": look.shell, "colour": look.colour, "above": shell_from_above(look.shell, look.colour)}


def car_document(number: int, name: str, look: VehicleLook, trace_csv: bytes, laps: Sequence[LapDocument]) -> ReplayCar:
    """One car. Raises PlatformFault as :func:`trace_columns`."""
    columns = trace_columns(trace_csv)
    return {
        "number": number,
        "name": name,
        "look": look_document(look),
        "laps": lap_documents(laps),
        "columns": columns,
        "events": car_events(number, columns, laps),
    }


def run_document(shown: Evaluation, cars: Sequence[CompetitorRow]) -> RunDocument:
    """A finished run with all of its ``cars`` (:func:`evaluation.running.competitors.car_rows`). Raises PlatformFault
    ``storage_failed``, ``file_damaged``."""
    own, *rivals = (
        car_document(car.number, car.label, car.look, read_trace(car.result), car.result.laps)
        for car in sorted(cars, key=lambda car: car.number)
    )
    layout = read_layout(shown.result)
    return {
        **own,
        "run": shown.public_id,
        "href": shown.get_absolute_url(),
        "engine": shown.result.engine,
        "track": shown.track.slug,
        "direction": direction_of(shown),
        "bots": [bot_columns(places) for places in layout["bots"]],
        "boxes": [box_document(box) for box in layout["boxes"]],
        "rivals": rivals,
        "events": sorted((event for car in (own, *rivals) for event in car["events"]), key=lambda event: event["t"]),
    }


def document_key(shown: Evaluation, cars: Sequence[CompetitorRow]) -> tuple:
    """All that :func:`run_document` depends on."""
    parts = [(car.number, car.label, car.look, car.result.trace_sha256) for car in cars]
    return "run document", RUN_FORMAT, shown.public_id, shown.result.engine, direction_of(shown), *parts


def bot_columns(places: Sequence[Sequence[float]]) -> dict[str, list[float]]:
    """A bot's places (metres and radians, one a step of the run's own car) as columns."""
    return {
        "x": [round(x, 3) for x, _, _ in places],
        "y": [round(y, 3) for _, y, _ in places],
        "yaw": [round(math.degrees(yaw), 1) for _, _, yaw in places],
    }


def box_document(box: BoxDocument) -> dict[str, float]:
    """A box with its middle in metres, its heading in degrees, and its size."""
    solid = box_solid(box["x"], box["y"], box["yaw"])
    return {
        "x": round(solid.x, 3),
        "y": round(solid.y, 3),
        "yaw": round(math.degrees(solid.yaw), 1),
        "length": 2 * solid.half_length,
        "width": 2 * solid.half_width,
        "height": solid.height,
    }


def scene_document(track: Track, direction: str) -> dict[str, object]:
    """The lines of a track in driving order, an open one's with its road before the start and beyond the finish.
    ``start`` and ``finish``: the middle of their line, its heading and the road's width there."""
    geometry = track.geometry.in_direction(direction)
    centre, inner, outer = geometry.lines
    if geometry.is_open:
        outer = outer[::-1]  # the line around an open road comes back along it
    return {
        "track": track.slug,
        "name": track.name,
        "direction": direction,
        "closed": not geometry.is_open,
        "length": round(geometry.length, 4),
        "width": round(float(geometry.half_widths.sum(axis=1).mean()), 4),
        "bounds": [round(each, 4) for each in geometry.bounds],
        "centre": _points(centre),
        "inner": _points(inner),
        "outer": _points(outer),
        "start": _line_across(geometry, 0.0),
        "finish": _line_across(geometry, geometry.finish_m),
        "turns": [turn._asdict() for turn in turns_of(track.geometry, direction)],
    }


def _points(line: Points) -> list[list[float]]:
    return [[round(x, 4), round(y, 4)] for x, y in line.tolist()]


def _line_across(geometry: Any, metres: float) -> dict[str, float]:
    x, y, yaw = geometry.point_at(metres)
    return {
        **{"x": round(x, 4), "y": round(y, 4), "yaw": round(math.degrees(yaw), 2)},
        "width": round(geometry.width_at(metres), 4),
    }
