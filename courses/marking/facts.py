"""What a mark is computed from, and what comes out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from typing import Any, TypedDict

Lap = Mapping[str, Any]
WAITING, FINISHED = "waiting", "finished"
BEST, LAST, FIRST_K = "best", "last", "first_k"


class Threshold(TypedDict):
    at_most_ms: int
    points: str | float  # text of forms, numbers of programs


class PassParams(TypedDict, total=False):
    """The values of a rule for passing (:class:`courses.marking.pass_rules.Param`)."""

    laps: int
    clean: bool
    at_most_ms: int
    by: str
    thresholds: list[Threshold]
    place: int


class TrackMarkDocument(TypedDict):
    track: int
    passed: bool | None
    value: int | None


class PartMarkDocument(TypedDict):
    """A :class:`PartMark` in rows of marks; points as text."""

    number: int
    points: str
    passed: bool | None
    why: str
    why_params: dict[str, int]
    tracks: list[TrackMarkDocument]


@dataclass(frozen=True)
class TrackRun:
    """The run of an attempt on one track; ``laps`` as of a result, none of a run that failed."""

    state: str = WAITING
    laps: tuple[Lap, ...] = ()

    @property
    def waits(self) -> bool:
        return self.state == WAITING


@dataclass(frozen=True)
class PartRules:
    """A part: ``tracks``: all that a car has to drive; ``to_draw``: how many more are drawn at the deadline."""

    number: int
    points: Decimal
    pass_rule: str
    pass_params: PassParams
    tracks: tuple[int, ...]
    to_draw: int = 0


@dataclass(frozen=True)
class AssignmentRules:
    """The rules that marks hang on. ``counts``: :data:`BEST`, :data:`LAST` or :data:`FIRST_K`."""

    due_at: datetime
    time_zone: str
    parts: tuple[PartRules, ...]
    late_points_a_day: Decimal = Decimal(0)
    counts: str = BEST
    first_k: int | None = None


@dataclass(frozen=True)
class AttemptFacts:
    """An attempt that was not given back; ``runs`` by track."""

    id: int
    accepted_at: datetime
    runs: Mapping[int, TrackRun] = field(default_factory=dict)


@dataclass(frozen=True)
class PartResult:
    """The runs of an attempt in a part, in the order of its tracks. ``place``: among the students; None while that is
    not known."""

    tracks: tuple[int, ...]
    runs: tuple[TrackRun, ...]
    to_draw: int = 0
    place: int | None = None

    @property
    def waits(self) -> bool:
        return self.to_draw > 0 or any(run.waits for run in self.runs)


@dataclass(frozen=True)
class TrackMark:
    """One track of a part: whether it passes, None while its run waits; ``value``: a time in ms, or laps in a row."""

    track: int
    passed: bool | None
    value: int | None


@dataclass(frozen=True)
class PartMark:
    """``passed``: None while something waits that decides it. ``why``: a code of the WHYS of assignments' wording."""

    points: Decimal
    passed: bool | None
    why: str
    why_params: Mapping[str, int] = field(default_factory=dict)
    tracks: tuple[TrackMark, ...] = ()
    number: int = 0

    def to_dict(self) -> PartMarkDocument:
        return {
            "number": self.number,
            "points": str(self.points),
            "passed": self.passed,
            "why": self.why,
            "why_params": dict(self.why_params),
            "tracks": [{"track": one.track, "passed": one.passed, "value": one.value} for one in self.tracks],
        }


@dataclass(frozen=True)
class MarkFacts:
    """A mark. ``attempt``: the id of the one that counts, None without any; ``is_complete``: nothing waits."""

    attempt: int | None
    points: Decimal
    before_late: Decimal
    late_days: int
    parts: tuple[PartMark, ...]
    is_complete: bool
