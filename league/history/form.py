"""The columns of a recorded season and what their cells mean. No database here.

``races.csv`` has a row for each race; ``file`` names its results, times are ISO 8601 with zone, penalties seconds.
The results have the columns of the old service's export: times in milliseconds, ``SubmissionTime`` milliseconds since
1970, ``RankingScore`` the time ranked by. A car that was not classified has no times, no laps and a score just below
2**63, the lower the farther it drove: 2**63 - 1 less its progress in per cent. A race of duels has scores of its own
(:mod:`league.history.duels`). Columns in which a cell is empty were
written with a decimal point there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from decimal import Decimal
from typing import Literal, TypeVar, overload

from paddock.errors import UserFault
from races.models import RaceType, RankingMethod

from ..models.season import Stage
from .duels import FIRST as FIRST_OF_DUELS
from .duels import LAST as LAST_OF_DUELS
from .duels import DuelScore, read_duel_score

LAPS_COLUMNS = ("minimum_laps", "maximum_laps")
RACE_COLUMNS = (
    *("file", "season", "name", "stage", "division", "race_type", "timing_method", *LAPS_COLUMNS),
    *("opens", "closes", "off_track_penalty_s", "collision_penalty_s", "bots", "bot_speed_mps", "obstacles"),
    *("track", "racers"),
)
RESULT_COLUMNS = (
    *("Alias", "SubmissionTime", "LapCount", "AvgLapTime", "BestLapTime", "TotalLapTime", "AvgResets"),
    *("CollisionCount", "OffTrackCount", "ResetCount", "SubmissionCount", "Rank"),
    *("LeaderboardSubmissionStatusType", "RankingScore", "RacingDivision", "UserId"),
)
OPTIONAL = frozenset({"RacingDivision"})  # races of no division have none

RACE_TYPES = {
    "time_trial": RaceType.TIME_TRIAL,
    "object_avoidance": RaceType.OBJECT_AVOIDANCE,
    "head_to_head_racing": RaceType.HEAD_TO_HEAD,
}
TIMING_METHODS = {
    "avg_lap_time": RankingMethod.AVERAGE,
    "best_lap_time": RankingMethod.BEST,
    "total_time": RankingMethod.TOTAL,
}
TIME_RANKED_BY = {
    RankingMethod.AVERAGE: "AvgLapTime",
    RankingMethod.BEST: "BestLapTime",
    RankingMethod.TOTAL: "TotalLapTime",
}
WORST_SCORE = 2**63 - 1
NO_SCORE = 2**62  # a score from here on is no time
MOST = 2**31 - 1  # what a column of the database holds
MOST_LAPS = 2**15 - 1
FIRST, LAST = datetime(1970, 1, 1, tzinfo=UTC), datetime(2200, 1, 1, tzinfo=UTC)

# No exponent that a computer could not write out: Decimal breaks down over such.
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?\Z", re.ASCII)


_Meaning = TypeVar("_Meaning")


@dataclass(frozen=True)
class RaceRow:
    """One row of ``races.csv``. ``cells``: as they stood, by column; ``row``: its number, the heading being row 1."""

    row: int
    cells: Mapping[str, str]
    file: str
    season: str
    name: str
    stage: Stage
    race_type: RaceType
    ranking_method: RankingMethod
    minimum_laps: int
    laps: int
    opens_at: datetime
    closes_at: datetime
    off_track_penalty_ms: int
    collision_penalty_ms: int
    bots: int
    bot_speed_mps: float | None
    obstacles: int
    track: str
    racers: int | None

    @property
    def laps_of_the_race(self) -> dict[str, int]:
        """How many laps are driven and how many must be complete, as fields of a race."""
        return {"laps": self.laps, "minimum_laps": self.minimum_laps}


@dataclass(frozen=True)
class ResultRow:
    """One row of a file of results. Times in milliseconds, None where nothing was driven for it.

    ``score``: as recorded; ``score_ms``: the time ranked by, None for who is not classified; ``driven_percent``: how
    far such a car came; ``measured``: whether the recorded score is that time; ``blank``: columns whose cell was empty;
    ``duel``: what the score says in a race of duels.
    """

    row: int
    alias: str
    racer: str
    submitted_at: datetime
    laps: int
    average_ms: int | None
    best_lap_ms: int | None
    total_ms: int | None
    average_resets: float
    collisions: int
    off_tracks: int
    resets: int
    submissions: int
    rank: int
    status: str
    score: int
    score_ms: int | None
    driven_percent: int
    measured: bool
    division: str
    blank: tuple[str, ...] = field(default=())
    duel: DuelScore | None = None


class Cells:
    """The cells of one row, read with a refusal that names file, row and column: UserFault("import_value")."""

    def __init__(self, file: str, row: int, cells: Mapping[str, str]) -> None:
        self.file, self.row, self.cells = file, row, cells

    def refuse(self, column: str, expected: str) -> UserFault:
        return UserFault(
            "import_value",
            file=self.file,
            row=self.row,
            column=column,
            value=self.cells.get(column, "")[:60],
            expected=expected,
        )

    def text(self, column: str, limit: int, *, empty: bool = False) -> str:
        """A text on one line."""
        text = self.cells.get(column, "").strip()
        if (not text and not empty) or len(text) > limit or not text.isprintable():
            raise self.refuse(column, f"a text on one line of at most {limit} characters")
        return text

    def word(self, column: str, words: Mapping[str, _Meaning]) -> _Meaning:
        """What one of ``words`` stands for."""
        word = self.cells[column].strip().lower()
        if word not in words:
            raise self.refuse(column, f"one of {', '.join(words)}")
        return words[word]

    @overload
    def whole(self, column: str, *, least: int = 0, most: int = MOST, empty: Literal[False] = False) -> int: ...

    @overload
    def whole(self, column: str, *, least: int = 0, most: int = MOST, empty: bool) -> int | None: ...

    def whole(self, column: str, *, least: int = 0, most: int = MOST, empty: bool = False) -> int | None:
        """A whole number, also one written with a decimal point; None for an empty cell that may be so."""
        text = self.cells.get(column, "").strip()
        if text.isdecimal() and text.isascii() and len(text) < 20:
            value: int | None = int(text)
        else:
            if not text and empty:
                return None
            number = self._decimal(text)
            value = None if number is None or number != int(number) else int(number)
        if value is None or not least <= value <= most:
            between = f"from {least} to {most}" if most != WORST_SCORE else f"of {least} or more"
            raise self.refuse(column, f"a whole number {between}")
        return value

    def number(self, column: str, *, most: float = 1e9, empty: bool = False) -> float | None:
        """A number of 0 or more."""
        text = self.cells.get(column, "").strip()
        if not text and empty:
            return None
        number = self._decimal(text)
        if number is None or not 0 <= number <= most:
            raise self.refuse(column, f"a number from 0 to {most:g}")
        return float(number)

    def time(self, column: str) -> datetime:
        """A moment in ISO 8601 with its zone."""
        try:
            time = datetime.fromisoformat(self.cells[column].strip())
        except ValueError:
            time = None
        if time is None or time.tzinfo is None:
            raise self.refuse(column, "a time with its zone, such as 2022-03-01T00:00:00+00:00")
        if not FIRST <= time < LAST:  # pages show it in any zone, which no time at an end of the calendar bears
            raise self.refuse(column, "a time from 1970 to 2199")
        return time.astimezone(UTC)

    @staticmethod
    def _decimal(text: str) -> Decimal | None:
        if len(text) > 40 or not _NUMBER.match(text):
            return None
        number = Decimal(text)
        return number if abs(number) < Decimal("1e20") else None


def race_row(row: int, cells: Mapping[str, str]) -> RaceRow:
    """A row of ``races.csv``. Raises UserFault("import_value" | "import_times")."""
    read = Cells("races.csv", row, cells)
    minimum = read.whole("minimum_laps", least=1, most=MOST_LAPS, empty=True) or 1
    laps = read.whole("maximum_laps", least=1, most=MOST_LAPS, empty=True) or minimum
    if laps < minimum:
        raise read.refuse("maximum_laps", f"at least the {minimum} of minimum_laps")
    opens, closes = read.time("opens"), read.time("closes")
    if closes <= opens:
        raise UserFault("import_times", row=row)
    speed = read.number("bot_speed_mps", most=100, empty=True)
    return RaceRow(
        row=row,
        cells={column: cells[column] for column in RACE_COLUMNS},
        file=read.text("file", 200),
        season=read.text("season", 50),
        name=read.text("name", 64),
        stage=read.word("stage", {stage.value: stage for stage in Stage}),
        race_type=read.word("race_type", RACE_TYPES),
        ranking_method=read.word("timing_method", TIMING_METHODS),
        minimum_laps=minimum,
        laps=laps,
        opens_at=opens,
        closes_at=closes,
        off_track_penalty_ms=round(1000 * (read.number("off_track_penalty_s", most=3600, empty=True) or 0)),
        collision_penalty_ms=round(1000 * (read.number("collision_penalty_s", most=3600, empty=True) or 0)),
        bots=read.whole("bots", most=100, empty=True) or 0,
        bot_speed_mps=speed,
        obstacles=read.whole("obstacles", most=100, empty=True) or 0,
        track=read.text("track", 64),
        racers=read.whole("racers", empty=True),
    )


def result_row(file: str, row: int, cells: Mapping[str, str], method: RankingMethod) -> ResultRow:
    """A row of results of a race ranked by ``method``. Raises UserFault("import_value")."""
    read = Cells(file, row, cells)
    times = {name: read.whole(name, empty=True) for name in ("BestLapTime", "TotalLapTime")}
    average = read.number("AvgLapTime", most=MOST, empty=True)
    times["AvgLapTime"] = None if average is None else math.floor(average)  # as everywhere: rounded down
    score = min(read.whole("RankingScore", most=10**19), WORST_SCORE)
    best = times["BestLapTime"]
    classified = score < NO_SCORE and best is not None
    ranked_by = times[TIME_RANKED_BY[method]]
    duel = read_duel_score(score) if FIRST_OF_DUELS <= score <= LAST_OF_DUELS else None
    if MOST < score < NO_SCORE and (duel is None or ranked_by is None or best is None):
        raise read.refuse("RankingScore", f"a time of at most {MOST} ms, or no time at all ({NO_SCORE} or more)")
    score_ms = score if duel is None else ranked_by
    driven = WORST_SCORE - score
    return ResultRow(
        row=row,
        alias=read.text("Alias", 64),
        racer=read.text("UserId", 64),
        submitted_at=_moment(read),
        laps=read.whole("LapCount", most=MOST_LAPS, empty=True) or 0,
        average_ms=times["AvgLapTime"],
        best_lap_ms=best,
        total_ms=times["TotalLapTime"],
        average_resets=read.number("AvgResets", empty=True) or 0.0,
        collisions=read.whole("CollisionCount", empty=True) or 0,
        off_tracks=read.whole("OffTrackCount", empty=True) or 0,
        resets=read.whole("ResetCount", empty=True) or 0,
        submissions=read.whole("SubmissionCount", most=MOST_LAPS, empty=True) or 0,
        rank=read.whole("Rank", least=1),
        status=read.text("LeaderboardSubmissionStatusType", 32, empty=True),
        score=score,
        score_ms=score_ms if classified else None,
        driven_percent=driven if driven <= 1_000_000 else 0,
        measured=ranked_by == score if score < NO_SCORE else ranked_by is None,
        division=read.text("RacingDivision", 32, empty=True),
        blank=tuple(name for name in RESULT_COLUMNS if name in cells and not cells[name].strip()),
        duel=duel,
    )


def _moment(read: Cells) -> datetime:
    milliseconds = read.whole("SubmissionTime", most=10**14)
    try:
        return datetime.fromtimestamp(milliseconds // 1000, UTC).replace(microsecond=milliseconds % 1000 * 1000)
    except (ValueError, OverflowError, OSError):
        raise read.refuse("SubmissionTime", "a moment in milliseconds since 1970") from None


def milliseconds_of(moment: datetime) -> int:
    """A moment as ``SubmissionTime`` counts it."""
    return math.floor(moment.timestamp()) * 1000 + moment.microsecond // 1000
