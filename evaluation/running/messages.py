"""The messages of the referee's process, as JSON carries them."""

from typing import Annotated, NotRequired, TypedDict

from paddock.simulator.results import LapDocument


class FaultDocument(TypedDict):
    """A fault: its reason code and the values of its sentence."""

    code: str
    params: dict[str, str | int | float]
    fault: NotRequired[str]


class DrivenLapDocument(LapDocument):
    """One lap; times in whole simulated milliseconds."""


class RivalProgressDocument(TypedDict):
    """The progress of another submitted car."""

    lap: int
    percent: float
    total_ms: int
    x: float
    y: float
    off_tracks: int
    crashes: int
    retired: bool


class ProgressDocument(TypedDict):
    """The progress of a run."""

    lap: int
    laps: int
    lap_ms: int
    total_ms: int
    percent: float
    x: float
    y: float
    off_tracks: int
    crashes: int
    resets: int
    last_lap_ms: int | None
    bots: Annotated[list[tuple[float, float]], "x, y of each."]
    rivals: list[RivalProgressDocument]


class RunnerProgress(ProgressDocument, total=False):
    """The progress that a referee reports. ``done``: laps of a report that are driven."""

    done: int


class CarDocument(TypedDict):
    """One car of a race that is over. ``metrics``: the field's evaluation metrics."""

    laps: list[DrivenLapDocument]
    end_reason: str
    retired: FaultDocument | None
    trace_sha256: str
    metrics: dict[str, object]


class DriveDocument(TypedDict):
    """One lap of a report; see :class:`evaluation.running.drives.DriveOutcome`."""

    complete: bool
    time_ms: int
    percent: float
    end_reason: str
    status: str
    x: float
    y: float
    trace_sha256: str


class ResultDocument(TypedDict, total=False):
    """A race that is over, or the ``drives`` of a report."""

    cars: list[CarDocument]
    order: list[int]
    simulated_ms: int
    steps: int
    drives: list[DriveDocument]
    engine: str
    versions: dict[str, str]
    ways: list[int]


class RetiredDocument(TypedDict):
    """A car that was taken off the track."""

    car: int
    error: FaultDocument


class RunnerMessage(TypedDict, total=False):
    """A message of the referee: one of ``headers``, ``progress``, ``retired``, ``error`` and ``result``."""

    headers: list[dict[str, object]]
    progress: RunnerProgress
    retired: RetiredDocument
    error: FaultDocument
    result: ResultDocument
    seconds: dict[str, float]
    ways: list[list[int]]
