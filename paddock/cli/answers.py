"""The parts of the API's answers that the commands read."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypedDict

if TYPE_CHECKING:
    from paddock.simulator.results import LapDocument


class ErrorAnswer(TypedDict):
    """An error. ``fault``: ``user`` or ``platform``."""

    code: str
    message: str
    fault: str
    params: Mapping[str, Any]


class ModelAnswer(TypedDict):
    """A model. ``upload``: only in the answer to an upload."""

    public_id: str
    owner: str
    name: str
    description: str
    sha256: str
    parameters: int
    sensors: list[str]
    uploaded_at: str
    shared: bool
    upload: "UploadAnswer"


class UploadAnswer(TypedDict):
    network: str
    ignored: list[str]


class ProgressAnswer(TypedDict):
    lap: int
    laps: int
    percent: float
    total_ms: int


class QueueAnswer(TypedDict):
    position: int
    waiting: int
    expected_wait_s: float | None


class ReasonAnswer(TypedDict):
    code: str
    sentence: str


class CarAnswer(TypedDict):
    number: int
    laps: "list[LapDocument]"
    end_reason: str
    retired: Mapping[str, Any] | None


class ResultAnswer(CarAnswer):
    """The result of a run: of its first car, and of its ``rivals``."""

    best_lap_ms: int | None
    total_ms: int
    engine: str
    versions: dict[str, str]
    trace_sha256: str
    order: list[int]
    rivals: list[CarAnswer]


class RunAnswer(TypedDict):
    public_id: str
    state: str
    queue: QueueAnswer | None
    progress: ProgressAnswer | None
    result: ResultAnswer | None
    reason: ReasonAnswer | None


class SpecifiedCar(TypedDict):
    """A car in a specification. ``open``: its network may be downloaded."""

    number: int
    racer: str
    open: bool
    model: ModelAnswer
    trace_sha256: str


class Specification(TypedDict):
    """What a run drives. ``cars`` are missing in the specification of a race."""

    engine: str
    track: dict[str, Any]
    rules: Mapping[str, Any]
    cars: list[SpecifiedCar]


class EntryAnswer(TypedDict):
    classified: bool
    rank: int | None
    score_ms: int | None
    submissions_left: int | None


class IterationAnswer(TypedDict):
    number: int
    steps: int
    mean_reward: float | None
    eval_progress: float
    eval_lap_ms: int | None
    is_best: bool


class TrainingAnswer(TypedDict):
    public_id: str
    name: str
    state: str
    queue_position: int | None
    steps: int
    training_s: float
    ending: str
    reason: str
    printed: str
    iterations: list[IterationAnswer]
    best_model: str | None
    last_model: str | None


class VideoAnswer(TypedDict):
    """A video of a run. ``progress``: percent."""

    public_id: str
    state: str
    position: int
    progress: int
    reason: ReasonAnswer | None
