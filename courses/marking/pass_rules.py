"""The rules for passing, one class each. To add one, write a subclass and decorate it with :func:`register`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from typing import Any

from paddock.errors.reasons import gettext_noop as _

from .facts import FINISHED, Lap, PartMark, PartResult, PassParams, TrackMark, TrackRun

_Tracks = tuple[TrackMark, ...]
NOTHING = Decimal(0)
MOST_LAPS, MOST_MS, MOST_PLACE, MOST_THRESHOLDS = 20, 1_200_000, 10_000, 20
BY_BEST, BY_AVERAGE = "best", "average"


@dataclass(frozen=True)
class Param:
    """A value of a rule. ``kind``: ``int``, ``bool``, ``choice`` or ``thresholds``."""

    name: str
    label: str
    kind: str = "int"
    least: int = 1
    most: int = MOST_LAPS
    default: Any = None
    unit: str = ""
    choices: tuple[tuple[str, str], ...] = ()

    def problem(self, value: Any) -> str:
        """The reason code of a wrong value, or ``""``."""
        if self.kind == "bool":
            return "" if isinstance(value, bool) else "assignment_value_bool"
        if self.kind == "choice":
            return "" if value in [choice for choice, _label in self.choices] else "assignment_value_choice"
        if self.kind == "thresholds":
            return "" if _are_thresholds(value, self) else "assignment_thresholds"
        whole = isinstance(value, int) and not isinstance(value, bool)
        return "" if whole and self.least <= value <= self.most else "assignment_value"


def _are_thresholds(value: Any, param: Param) -> bool:
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= MOST_THRESHOLDS:
        return False
    for one in value:
        if not isinstance(one, Mapping) or set(one) != {"at_most_ms", "points"}:
            return False
        time = one["at_most_ms"]
        if not isinstance(time, int) or isinstance(time, bool) or not param.least <= time <= param.most:
            return False
        try:
            points = Decimal(str(one["points"]))
        except InvalidOperation:
            return False
        if not points.is_finite() or points < 0:
            return False
    return True


class PassRule(ABC):
    """One rule. ``code``: in rows and the API; ``label``: in lists; ``text``: the rule as a sentence with the names of
    its ``params``, ``text_one``: the same for one lap; they are translated by :mod:`courses.assignments.wording`."""

    code: str
    label: str
    text: str
    text_one = ""
    params: tuple[Param, ...] = ()
    unit = "ms"
    needs_place = False

    @abstractmethod
    def value(self, laps: Sequence[Lap], params: PassParams) -> int | None:
        """The figure of one run that decides; None for none."""

    @abstractmethod
    def passes(self, value: int, params: PassParams) -> bool:
        """Whether a figure passes."""

    def why_not(self, value: int | None, params: PassParams) -> tuple[str, dict[str, int]]:
        """The code and values of why a track does not pass."""
        return ("no_lap", {}) if value is None else ("too_slow", {"value": value, "at_most_ms": params["at_most_ms"]})

    def points(self, result: PartResult, params: PassParams, full: Decimal) -> PartMark:
        """All points where every track passes, else none."""
        tracks = self.track_marks(result, params)
        failed = next((one for one in tracks if one.passed is False), None)
        if failed is not None:
            why, why_params = self.why_not(failed.value, params)
            return PartMark(NOTHING, False, why, why_params, tracks)
        if result.waits:
            return waiting(result, tracks)
        if not tracks:
            return PartMark(NOTHING, False, "not_driven")
        return self.mark(result, tracks, params, full)

    def mark(self, result: PartResult, tracks: _Tracks, params: PassParams, full: Decimal) -> PartMark:
        """The mark of a part that was driven to its end and that no track fails."""
        return PartMark(full, True, "passed", {}, tracks)

    def track_marks(self, result: PartResult, params: PassParams) -> _Tracks:
        """Each track by itself."""
        marks = []
        for track, run in zip(result.tracks, result.runs, strict=True):
            value = self.value(run.laps, params) if run.state == FINISHED else None
            passed = value is not None and self.passes(value, params)
            marks.append(TrackMark(track, None if run.waits else passed, value))
        return tuple(marks)

    def uses_laps(self, params: Mapping[str, object]) -> bool:
        """Whether the number of laps in a row has an effect."""
        return "laps" in params and params.get("by") != BY_BEST

    def default_params(self) -> dict[str, object]:
        return {one.name: one.default for one in self.params}


PASS_RULES: dict[str, PassRule] = {}


def register(kind: type[PassRule]) -> type[PassRule]:
    """Add a rule. Raises ValueError for a code that is taken."""
    if kind.code in PASS_RULES:
        raise ValueError(f"another rule for passing has the code {kind.code}")
    PASS_RULES[kind.code] = kind()
    return kind


def waiting(result: PartResult, tracks: _Tracks = ()) -> PartMark:
    """The mark of a part that cannot be decided yet."""
    runs_wait = any(run.waits for run in result.runs)
    return PartMark(NOTHING, None, "waits" if runs_wait else "hidden_waits", {}, tracks)


def streak(laps: Sequence[Lap], *, clean: bool) -> int:
    """The most complete laps in a row; ``clean``: without a reset."""
    longest = now = 0
    for lap in laps:
        now = now + 1 if lap["complete"] and not (clean and lap["resets"]) else 0
        longest = max(longest, now)
    return longest


def best_lap_ms(laps: Sequence[Lap]) -> int | None:
    return min((lap["time_ms"] for lap in laps if lap["complete"]), default=None)


def average_lap_ms(laps: Sequence[Lap], needed: int) -> int | None:
    """The lowest average over any window of so many complete laps in a row, rounded down, as boards have it."""
    windows = (laps[at : at + needed] for at in range(len(laps) - needed + 1))
    return min(
        (sum(lap["time_ms"] for lap in one) // needed for one in windows if all(lap["complete"] for lap in one)),
        default=None,
    )


_LAPS = Param("laps", _("Laps in a row"), default=3)
_AT_MOST = Param("at_most_ms", _("Time limit"), least=1, most=MOST_MS, default=15_000, unit="ms")
_BY = Param(
    "by",
    _("Time that counts"),
    kind="choice",
    default=BY_AVERAGE,
    choices=((BY_BEST, _("best lap")), (BY_AVERAGE, _("average lap"))),
)


@register
class LapsInRow(PassRule):
    """So many complete laps in a row on every track."""

    code = "laps_in_row"
    label = _("complete laps in a row")
    text = _("%(laps)s complete laps in a row on each track.")
    text_one = _("A complete lap on each track.")
    params = (
        Param("laps", _("Laps in a row"), default=5),
        Param("clean", _("A lap with a reset does not count"), kind="bool", default=True),
    )
    unit = "laps"

    def value(self, laps: Sequence[Lap], params: PassParams) -> int | None:
        return streak(laps, clean=params.get("clean", True))

    def passes(self, value: int, params: PassParams) -> bool:
        return value >= params["laps"]

    def why_not(self, value: int | None, params: PassParams) -> tuple[str, dict[str, int]]:
        return "too_few_laps", {"value": value or 0, "laps": params["laps"]}


@register
class BestLapLimit(PassRule):
    """The best complete lap within a time on every track."""

    code = "best_lap"
    label = _("best lap within a time")
    text = _("A best lap of at most %(at_most_ms)s on each track.")
    params: tuple[Param, ...] = (_AT_MOST,)

    def value(self, laps: Sequence[Lap], params: PassParams) -> int | None:
        return best_lap_ms(laps)

    def passes(self, value: int, params: PassParams) -> bool:
        return value <= params["at_most_ms"]


@register
class AverageLapLimit(BestLapLimit):
    """The average of so many laps in a row within a time on every track."""

    code = "average_lap"
    label = _("average lap within a time")
    text = _("An average of %(laps)s laps in a row of at most %(at_most_ms)s on each track.")
    text_one = BestLapLimit.text
    params = (_LAPS, _AT_MOST)

    def value(self, laps: Sequence[Lap], params: PassParams) -> int | None:
        return average_lap_ms(laps, params["laps"])


class _ByTime(PassRule):
    """By the best or the average lap."""

    def value(self, laps: Sequence[Lap], params: PassParams) -> int | None:
        return best_lap_ms(laps) if params["by"] == BY_BEST else average_lap_ms(laps, params["laps"])

    def passes(self, value: int, params: PassParams) -> bool:
        return True


@register
class Thresholds(_ByTime):
    """Points by the time of the slowest track."""

    code = "thresholds"
    label = _("points by time")
    text = _("Points by time: %(thresholds)s. The slowest track counts.")
    params = (
        Param("thresholds", _("Times and points"), kind="thresholds", most=MOST_MS, default=()),
        _BY,
        _LAPS,
    )

    def mark(self, result: PartResult, tracks: _Tracks, params: PassParams, full: Decimal) -> PartMark:
        slowest = max(one.value for one in tracks if one.value is not None)
        reached = [one for one in params["thresholds"] if slowest <= one["at_most_ms"]]
        points = min(full, max((Decimal(str(one["points"])) for one in reached), default=NOTHING))
        return PartMark(points, points > 0, "by_time", {"value": slowest}, tracks)


@register
class PlaceReached(_ByTime):
    """A place among the students, by the sum of the times of all tracks, once all results are there."""

    code = "place"
    label = _("a place among the students")
    text = _("At least place %(place)s among the students.")
    params = (Param("place", _("Place"), most=MOST_PLACE, default=10), _BY, _LAPS)
    needs_place = True

    def key(self, result: PartResult, params: PassParams) -> int | None:
        """What the place goes by, smaller is better; None without a time on every track."""
        values = [one.value for one in self.track_marks(result, params)]
        return None if not values or None in values else sum(value for value in values if value is not None)

    def mark(self, result: PartResult, tracks: _Tracks, params: PassParams, full: Decimal) -> PartMark:
        if result.place is None:
            return PartMark(NOTHING, None, "place_waits", {}, tracks)
        passed = result.place <= params["place"]
        return PartMark(full if passed else NOTHING, passed, "place", {"value": result.place}, tracks)


def result_of(tracks: tuple[int, ...], runs: Mapping[int, TrackRun], to_draw: int) -> PartResult:
    """The runs on ``tracks``; what was not queued yet waits."""
    return PartResult(tracks, tuple(runs.get(track, TrackRun()) for track in tracks), to_draw)
