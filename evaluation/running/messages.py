"""The messages of the referee's process, as JSON carries them."""

from collections.abc import Mapping
from typing import NotRequired, TypedDict

from paddock.simulator.results import Fault, LapDocument, ProgressDocument


class CarDocument(TypedDict):
    """One car of a race that is over. ``metrics``: the field's evaluation metrics."""

    laps: list[LapDocument]
    end_reason: str
    retired: Fault | None
    trace_sha256: str
    metrics: Mapping[str, object]


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
    error: Fault


class RunProgress(ProgressDocument):
    """The progress of a race; of a report ``done`` alone, the number of its driven laps."""

    done: NotRequired[int]


class RunnerMessage(TypedDict, total=False):
    """A message of the referee: one of ``headers``, ``progress``, ``retired``, ``error`` and ``result``."""

    headers: list[dict[str, object]]
    progress: RunProgress
    retired: RetiredDocument
    error: Fault
    result: ResultDocument
    seconds: dict[str, float]
    ways: list[list[int]]
