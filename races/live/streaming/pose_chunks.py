"""A run for spectators in chunks of half a second, each released once its time has passed.

All functions are pure except :func:`chunks_of`, which reads the run's files and caches the last few runs.
"""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Annotated, Any, NotRequired, TypedDict

from evaluation.models import Result
from evaluation.running.results import read_layout, read_trace

from ...boards.ranking import Lap
from ...replays.document import bot_columns, trace_columns

CHUNK_MS = 500
_COLUMNS = ("t", "x", "y", "yaw", "v", "steer", "lap", "status", "progress")
_BOT_COLUMNS = ("x", "y", "yaw")
# public incidents besides crossing a line, by the new status of a step
_INCIDENTS = ("off_track", "crashed", "immobilized", "reversed", "time_up")

Columns = Mapping[str, Any]  # of a whole run, by name


class CarPoses(TypedDict):
    """A car's steps as columns of equal length, as :class:`races.replays.document.RunColumns` has them."""

    number: int
    t: list[int]
    x: list[float]
    y: list[float]
    yaw: list[float]
    v: list[float]
    steer: list[float]
    lap: list[int]
    status: list[str]
    progress: list[float]


class BotPoses(TypedDict):
    """A bot's steps as columns."""

    x: list[float]
    y: list[float]
    yaw: list[float]


class RunEvent(TypedDict):
    """A sector (from 1) or a lap that was finished in ``ms``, or an incident, ``t`` ms after the start."""

    t: int
    car: int
    kind: str
    lap: int
    sector: NotRequired[int]
    ms: NotRequired[int]


class ChunkDocument(TypedDict):
    """Half a second of a run."""

    n: Annotated[int, "It begins n times chunk_ms after the start."]
    cars: Annotated[
        list[CarPoses],
        "For each its number, and columns as in replay.json: t (ms), x, y (m, the nose), yaw (degrees anticlockwise), "
        "v (m/s), steer (degrees), lap (from 1), status, progress (percent of the lap).",
    ]
    bots: Annotated[list[BotPoses], "For each bot x, y (its middle) and yaw."]
    events: Annotated[list[RunEvent], "What happened: t, car, kind (sector, lap, off_track, ...), lap, ms."]


def passed(starts_at: datetime, now: datetime) -> int:
    """How many chunks of a run that started at ``starts_at`` have wholly passed at ``now``."""
    return max(0, (now - starts_at) // timedelta(milliseconds=CHUNK_MS))


def chunks_of(result: Result) -> tuple[ChunkDocument, ...]:
    """All chunks of a run, in order, their events by ``t``. What of it may leave the server is for :func:`passed` to
    decide."""
    return _chunks(result.pk, result.trace.name or "")


@lru_cache(maxsize=16)
def _chunks(pk: int, trace: str) -> tuple[ChunkDocument, ...]:
    result = Result.with_sealed.prefetch_related("rivals").get(pk=pk)
    driven = {0: result, **{rival.number: rival for rival in result.rivals.all()}}
    cars: Any = [{"number": number, **trace_columns(read_trace(car))} for number, car in sorted(driven.items())]
    bots = [bot_columns(places) for places in read_layout(result).get("bots", ())]
    return cut(cars, bots, {number: car.laps for number, car in driven.items()})


def cut(
    cars: Sequence[Columns], bots: Sequence[Columns], laps: Mapping[int, Sequence[Lap]]
) -> tuple[ChunkDocument, ...]:
    """Columns of whole runs, and their laps by the number of the car, in chunks of :data:`CHUNK_MS`."""
    happened = sorted(
        (event for car in cars for event in [*_crossings(car["number"], laps[car["number"]]), *_incidents(car)]),
        key=lambda event: (event["t"], event["car"]),
    )
    last = max([*(car["t"][-1] for car in cars if car["t"]), *(event["t"] for event in happened)], default=-1)
    return tuple(_chunk(n, cars, bots, happened) for n in range(last // CHUNK_MS + 1))


def line_of(chunks: Sequence[ChunkDocument], lap: int | None) -> dict[str, list[Any]]:
    """The columns of the car that was timed through chunks of a run: of lap ``lap`` with ``t`` since its beginning, or
    of the whole run. Empty for a lap that was not completed."""
    begins, ends = 0, None
    if lap is not None:
        crossed = [event for chunk in chunks for event in chunk["events"] if event["car"] == 0]
        found = [event for event in crossed if event["kind"] == "lap" and event["lap"] == lap]
        begins, ends = (found[0]["t"] - found[0]["ms"], found[0]["t"]) if found else (0, -1)
    line: dict[str, list[Any]] = {name: [] for name in _COLUMNS}
    for chunk in chunks:
        first: Sequence[Columns] = chunk["cars"][:1]
        for car in first:
            rows = [at for at, t in enumerate(car["t"]) if begins <= t and (ends is None or t <= ends)]
            for name in _COLUMNS:
                line[name] += [car[name][at] - begins if name == "t" else car[name][at] for at in rows]
    return line


def _chunk(n: int, cars: Sequence[Columns], bots: Sequence[Columns], happened: Sequence[RunEvent]) -> ChunkDocument:
    def rows(car: Columns) -> list[int]:
        return [index for index, t in enumerate(car["t"]) if t // CHUNK_MS == n]

    steps = rows(cars[0]) if cars else []
    cut_cars: Any = [
        {"number": car["number"], **{name: [car[name][index] for index in rows(car)] for name in _COLUMNS}}
        for car in cars
    ]
    cut_bots: Any = [
        {name: [bot[name][index] for index in steps if index < len(bot[name])] for name in _BOT_COLUMNS} for bot in bots
    ]
    events = [event for event in happened if event["t"] // CHUNK_MS == n]
    return {"n": n, "cars": cut_cars, "bots": cut_bots, "events": events}


def _crossings(number: int, laps: Sequence[Lap]) -> list[RunEvent]:
    """Lines that a car crossed. Of a lap that was not finished the sectors that were."""
    found: list[RunEvent] = []
    for lap in laps:
        at = lap["start_ms"]
        for sector, time_ms in enumerate(lap.get("sector_ms") or (), start=1):
            at += time_ms
            found.append(
                {"t": at, "car": number, "kind": "sector", "lap": lap["number"], "sector": sector, "ms": time_ms}
            )
        if lap["complete"]:
            at = lap["start_ms"] + lap["time_ms"]
            found.append({"t": at, "car": number, "kind": "lap", "lap": lap["number"], "ms": lap["time_ms"]})
    return found


def _incidents(car: Columns) -> list[RunEvent]:
    found: list[RunEvent] = []
    before = ""
    for t, lap, status in zip(car["t"], car["lap"], car["status"], strict=True):
        if status != before and status in _INCIDENTS:
            found.append({"t": t, "car": car["number"], "kind": status, "lap": lap})
        before = status
    return found
