"""The result of a race: laps, progress while it runs, and the evaluation metrics file of the field."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Annotated, TypedDict, cast

from .layout import LayoutDocument
from .trace import Trace


class LapDocument(TypedDict):
    """One lap; times in whole simulated milliseconds."""

    number: int
    start_ms: int
    time_ms: int
    complete: bool
    off_tracks: int
    crashes: int
    resets: int
    immobilised: int
    reversals: int
    sector_ms: Annotated[list[int], "Three when the lap is complete."]
    completion_percentage: int
    status: str


@dataclass
class Lap:
    """One lap. Times are milliseconds since the start of the run."""

    number: int
    start_ms: int
    end_ms: int | None = None  # None until the line is crossed
    off_tracks: int = 0
    crashes: int = 0
    resets: int = 0
    immobilised: int = 0
    reversals: int = 0
    sector_ends_ms: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class LapResult:
    """One lap, in whole simulated milliseconds. ``sector_ms``: of the sectors driven, three of a complete lap.
    ``time_ms`` of an incomplete lap: the time spent in it. ``status``: a label of LABELS."""

    number: int
    start_ms: int
    time_ms: int
    complete: bool
    off_tracks: int
    crashes: int
    resets: int
    immobilised: int
    reversals: int
    sector_ms: list[int]
    completion_percentage: int
    status: str

    def to_dict(self) -> LapDocument:
        return cast(LapDocument, asdict(self))


class CarProgressDocument(TypedDict):
    """A :class:`CarProgress` as JSON carries it."""

    lap: int
    total_ms: int
    percent: float
    x: float
    y: float
    off_tracks: int
    crashes: int


class RivalProgressDocument(CarProgressDocument):
    retired: bool


class ProgressDocument(CarProgressDocument):
    laps: int
    lap_ms: int
    resets: int
    last_lap_ms: int | None
    bots: list[tuple[float, float]]
    rivals: list[RivalProgressDocument]


@dataclass(frozen=True, kw_only=True)
class CarProgress:
    """The progress of a car while a race runs. ``x``, ``y``: of its nose, metres."""

    lap: int
    total_ms: int
    percent: float
    x: float
    y: float
    off_tracks: int
    crashes: int


@dataclass(frozen=True, kw_only=True)
class RivalProgress(CarProgress):
    """The progress of another car. ``retired``: its policy failed."""

    retired: bool


@dataclass(frozen=True, kw_only=True)
class Progress(CarProgress):
    """The progress of a race, seen by its first car. ``bots``: x and y of each, metres."""

    laps: int
    lap_ms: int
    resets: int
    last_lap_ms: int | None
    bots: Annotated[list[tuple[float, float]], "x, y of each."]
    rivals: list[RivalProgress]

    def to_dict(self) -> ProgressDocument:
        return cast(ProgressDocument, asdict(self))


class Fault(TypedDict):
    """The fault of a policy that retired its car."""

    code: str
    params: Mapping[str, object]


@dataclass(frozen=True, kw_only=True)
class CompetitorRun:
    """The run of one car. ``end_reason``: "laps_done", "time_up", "resets_used" or "retired"."""

    laps: list[LapResult]
    end_reason: str
    simulated_ms: int
    steps: int
    trace: Trace
    retired: Fault | None = None


@dataclass(frozen=True, kw_only=True)
class RaceResult(CompetitorRun):
    """The run of the first car, and the race around it. All but ``seconds`` is the same on every run.

    ``layout``: its bots have a place for each row of the first car's trace. ``order``: the cars from the winner on, 0
    being the first car and 1 the first of ``rivals``. ``seconds``: of wall time in physics, camera, policy, other.
    """

    engine: str
    versions: dict[str, str]
    seconds: dict[str, float] = field(compare=False)
    layout: LayoutDocument
    rivals: list[CompetitorRun]
    order: list[int]


def metrics_json(run: CompetitorRun) -> dict[str, list[dict[str, int | str]]]:
    """``{"metrics": [one dict a lap]}`` with times in simulated milliseconds (deepracer-simapp, metrics/s3_metrics.py).

    ``episode``, ``phase`` and ``reward_score`` belong to the training file of the same family; deepracer-utils reads no
    metrics without them.
    """
    return {
        "metrics": [
            {
                "completion_percentage": lap.completion_percentage,
                "metric_time": lap.start_ms + lap.time_ms,
                "start_time": lap.start_ms,
                "elapsed_time_in_milliseconds": lap.time_ms,
                "episode_status": lap.status,
                "crash_count": lap.crashes,
                "immobilized_count": lap.immobilised,
                "off_track_count": lap.off_tracks,
                "reversed_count": lap.reversals,
                "reset_count": lap.resets,
                "trial": lap.number,
                "episode": lap.number,
                "phase": "evaluation",
                "reward_score": 0,
            }
            for lap in run.laps
        ]
    }
