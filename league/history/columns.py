"""The columns of a recorded season and how their cells are read, without a database."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from decimal import Decimal
from typing import TypeVar

from core.validators import invisible_character, normalized
from paddock.errors import UserFault
from paddock.rules.race import PENALTIES
from races.boards.ranking import RULES, RankingRule, drawn_rank
from races.models import RaceType
from races.ranks import NO_LAP_MS, SEEDS

from ..models.season import Stage

LAPS_COLUMNS = ("minimum_laps", "maximum_laps")
BOT_COLUMNS = ("bots", "bot_speed_mps")
PENALTY_COLUMNS = {name: f"{name.removesuffix('_ms')}_s" for name in PENALTIES}  # in seconds, by rule
RACE_COLUMNS = (
    *("file", "season", "name", "stage", "division", "race_type", "timing_method", *LAPS_COLUMNS),
    *("opens", "closes", *PENALTY_COLUMNS.values(), *BOT_COLUMNS, "obstacles"),
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
WORST_SCORE = 2**63 - 1
NO_SCORE = 2**62  # a score from here on is no time
MOST = 2**31 - 1  # what a column of the database holds
MOST_LAPS = 2**15 - 1
FIRST, LAST = datetime(1970, 1, 1, tzinfo=UTC), datetime(2200, 1, 1, tzinfo=UTC)

# No exponent that a computer could not write out: Decimal breaks down over such.
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?\Z", re.ASCII)


_Meaning = TypeVar("_Meaning")


FIRST_OF_DUELS, LAST_OF_DUELS = 2**61, 2**62 - 1
MOST_POINTS, MOST_DUELS = 2**15 - 1, 2**10 - 1
_UNDRAWN, _BRACKET, _CARS = 60, 59, 56
_POINTS, _LAP = 38, 10


@dataclass(frozen=True)
class DuelScore:
    """The recorded score of a car in a race of duels. ``seed`` None: not drawn, ranked by the qualifying ``time_ms``.

    The old service had no such races. The number is neither a time nor the score of a car without one (2**62 and more);
    smaller is better. Bit 60: not drawn (then the qualifying time follows); bit 59: a bracket; bits 56 to 58: the cars
    in a heat less 2; for drawn cars bits 38 to 52: the points missing to 32,767, bits 10 to 37: average lap and seed
    (``rank_lap`` of an entry), bits 0 to 9: the heats.
    """

    bracket: bool
    cars: int
    seed: int | None = None
    points: int = 0
    duels: int = 0
    lap_ms: int | None = None
    time_ms: int | None = None

    @property
    def number(self) -> int:
        head = FIRST_OF_DUELS + (int(self.bracket) << _BRACKET) + ((self.cars - 2) << _CARS)
        if self.seed is None:
            return head + (1 << _UNDRAWN) + (self.time_ms or 0)
        _score, lap = drawn_rank(self.points, self.lap_ms, self.seed)
        missing = MOST_POINTS - self.points
        return head + (missing << _POINTS) + (lap << _LAP) + min(self.duels, MOST_DUELS)


def read_duel_score(number: int) -> DuelScore | None:
    bracket, cars = bool(number >> _BRACKET & 1), (number >> _CARS & 7) + 2
    if number >> _UNDRAWN & 1:
        found = DuelScore(bracket, cars, time_ms=number & (1 << _CARS) - 1)
    else:
        lap_ms, seed = divmod(number >> _LAP & (1 << _POINTS - _LAP) - 1, SEEDS)
        points = MOST_POINTS - (number >> _POINTS & MOST_POINTS)
        lap = None if lap_ms == NO_LAP_MS else lap_ms
        if not seed or lap_ms > NO_LAP_MS:
            return None
        found = DuelScore(bracket, cars, seed, points, number & MOST_DUELS, lap)
    return found if found.number == number else None


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
    ranking_method: str
    minimum_laps: int
    laps: int
    opens_at: datetime
    closes_at: datetime
    penalties: Mapping[str, int]
    bots: int
    bot_speed_mps: float | None
    obstacles: int
    track: str
    racers: int | None

    @property
    def laps_of_the_race(self) -> dict[str, int]:
        return {"laps": self.laps, "minimum_laps": self.minimum_laps}


@dataclass(frozen=True)
class ResultRow:
    """One row of a file of results. Times in milliseconds, None for none.

    ``score_ms``: the time ranked by, None if not classified; ``driven_percent``: how far such a car came; ``measured``:
    whether the recorded ``score`` is that time; ``blank``: columns with an empty cell; ``duel``: parts of a duel score.
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
        text = normalized(self.cells.get(column, "").strip())
        if (not text and not empty) or len(text) > limit or invisible_character(text):
            raise self.refuse(column, f"a text on one line of at most {limit} characters")
        return text

    def word(self, column: str, words: Mapping[str, _Meaning]) -> _Meaning:
        """What one of ``words`` stands for."""
        word = self.cells[column].strip().lower()
        if word not in words:
            raise self.refuse(column, f"one of {', '.join(words)}")
        return words[word]

    def whole(self, column: str, *, least: int = 0, most: int = MOST) -> int:
        """A whole number, also one written with a decimal point."""
        text = self.cells.get(column, "").strip()
        if text.isdecimal() and text.isascii() and len(text) < 20:
            value: int | None = int(text)
        else:
            number = self._decimal(text)
            value = None if number is None or number != int(number) else int(number)
        if value is None or not least <= value <= most:
            between = f"from {least} to {most}" if most != WORST_SCORE else f"of {least} or more"
            raise self.refuse(column, f"a whole number {between}")
        return value

    def optional_whole(self, column: str, *, least: int = 0, most: int = MOST) -> int | None:
        """As :meth:`whole`; None for an empty cell."""
        return self.whole(column, least=least, most=most) if self.cells.get(column, "").strip() else None

    def optional_number(self, column: str, *, most: float = 1e9) -> float | None:
        """A number of 0 or more; None for an empty cell."""
        text = self.cells.get(column, "").strip()
        if not text:
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
    minimum = read.optional_whole("minimum_laps", least=1, most=MOST_LAPS) or 1
    laps = read.optional_whole("maximum_laps", least=1, most=MOST_LAPS) or minimum
    if laps < minimum:
        raise read.refuse("maximum_laps", f"at least the {minimum} of minimum_laps")
    opens, closes = read.time("opens"), read.time("closes")
    if closes <= opens:
        raise UserFault("import_times", row=row)
    speed = read.optional_number("bot_speed_mps", most=100)
    return RaceRow(
        row=row,
        cells={column: cells[column] for column in RACE_COLUMNS},
        file=read.text("file", 200),
        season=read.text("season", 50),
        name=read.text("name", 64),
        stage=read.word("stage", {stage.value: stage for stage in Stage}),
        race_type=read.word("race_type", RACE_TYPES),
        ranking_method=read.word("timing_method", {rule.record: rule.code for rule in RULES.values()}),
        minimum_laps=minimum,
        laps=laps,
        opens_at=opens,
        closes_at=closes,
        penalties={
            name: round(1000 * (read.optional_number(column, most=3600) or 0))
            for name, column in PENALTY_COLUMNS.items()
        },
        bots=read.optional_whole("bots", most=100) or 0,
        bot_speed_mps=speed,
        obstacles=read.optional_whole("obstacles", most=100) or 0,
        track=read.text("track", 64),
        racers=read.optional_whole("racers"),
    )


def result_row(file: str, row: int, cells: Mapping[str, str], method: RankingRule) -> ResultRow:
    """A row of results of a race ranked by ``method``. Raises UserFault("import_value")."""
    read = Cells(file, row, cells)
    times = {name: read.optional_whole(name) for name in ("BestLapTime", "TotalLapTime")}
    average = read.optional_number("AvgLapTime", most=MOST)
    times["AvgLapTime"] = None if average is None else math.floor(average)  # as everywhere: rounded down
    score = min(read.whole("RankingScore", most=10**19), WORST_SCORE)
    best = times["BestLapTime"]
    classified = score < NO_SCORE and best is not None
    duel = read_duel_score(score) if FIRST_OF_DUELS <= score <= LAST_OF_DUELS else None
    ranked_by = times.get(method.record_column, score if classified and duel is None else None)
    if MOST < score < NO_SCORE and (duel is None or ranked_by is None or best is None):
        raise read.refuse("RankingScore", f"a time of at most {MOST} ms, or no time at all ({NO_SCORE} or more)")
    score_ms = score if duel is None else ranked_by
    driven = WORST_SCORE - score
    return ResultRow(
        row=row,
        alias=read.text("Alias", 64),
        racer=read.text("UserId", 64),
        submitted_at=_moment(read),
        laps=read.optional_whole("LapCount", most=MOST_LAPS) or 0,
        average_ms=times["AvgLapTime"],
        best_lap_ms=best,
        total_ms=times["TotalLapTime"],
        average_resets=read.optional_number("AvgResets") or 0.0,
        collisions=read.optional_whole("CollisionCount") or 0,
        off_tracks=read.optional_whole("OffTrackCount") or 0,
        resets=read.optional_whole("ResetCount") or 0,
        submissions=read.optional_whole("SubmissionCount", most=MOST_LAPS) or 0,
        rank=read.whole("Rank", least=1),
        status=read.text("LeaderboardSubmissionStatusType", 32, empty=True),
        score=score,
        score_ms=score_ms if classified else None,
        driven_percent=driven if driven <= 1_000_000 else 0,
        measured=score >= NO_SCORE or ranked_by == score,
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
    return math.floor(moment.timestamp()) * 1000 + moment.microsecond // 1000
