"""The reader of a folder of seasons, which checks all of it before anything is written, without a database."""

import csv
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from pathlib import Path

from paddock.errors import UserFault
from races.boards.ranking import RULES
from races.models import RaceType

from ..models.season import Stage
from .columns import (
    OPTIONAL,
    RACE_COLUMNS,
    RESULT_COLUMNS,
    Cells,
    RaceRow,
    ResultRow,
    race_row,
    result_row,
)

INDEX = "races.csv"


@dataclass(frozen=True)
class ReadRace:
    """A race and its results in the order of their ranks. ``heading``: its columns; ``decimals``: those of them whose
    cells had a decimal point; ``number``: of its round in the season."""

    row: RaceRow
    heading: list[str]
    decimals: list[str]
    results: list[ResultRow]
    number: int


@dataclass(frozen=True)
class ReadSeason:
    """A season as read from its folder. ``digest``: sha-256 over everything that was read of it."""

    label: str
    races: list[ReadRace]
    digest: str

    @property
    def results(self) -> int:
        return sum(len(race.results) for race in self.races)


def read_folder(folder: Path, season: str | None = None) -> list[ReadSeason]:
    """The seasons of a folder, or the one named. Raises UserFault("import_...") with file, row (the heading is 1) and
    problem."""
    rows = [race_row(number, cells) for number, cells in _rows(folder, INDEX, RACE_COLUMNS)[1]]
    if not rows:
        raise UserFault("import_empty")
    _refuse_files(folder, rows)
    labels = list(dict.fromkeys(row.season for row in rows))
    if season is not None and season not in labels:
        raise UserFault("import_no_season", season=season[:60], seasons=", ".join(labels)[:200])
    return [
        _season(folder, label, [row for row in rows if row.season == label])
        for label in labels
        if season in (None, label)
    ]


def _season(folder: Path, label: str, rows: Sequence[RaceRow]) -> ReadSeason:
    digest = hashlib.sha256()
    numbers = _numbers(rows)
    races = []
    for row in rows:
        digest.update(repr(sorted(row.cells.items())).encode())
        digest.update(_bytes(folder, row.file))
        races.append(_race(folder, row, numbers[row.row]))
    return ReadSeason(label, races, digest.hexdigest())


def _race(folder: Path, row: RaceRow, number: int) -> ReadRace:
    heading, cells = _rows(folder, row.file, [name for name in RESULT_COLUMNS if name not in OPTIONAL])
    results: list[ResultRow] = []
    racers: dict[str, int] = {}
    aliases: dict[str, int] = {}
    pointed: set[str] = set()
    for at, one in cells:
        result = result_row(row.file, at, one, RULES[row.ranking_method])
        for seen, name in ((racers, result.racer), (aliases, result.alias.lower())):
            if name in seen:
                raise UserFault("import_duplicate_racer", file=row.file, row=at, racer=result.alias, other=seen[name])
            seen[name] = at
        pointed.update(name for name, cell in one.items() if cell.endswith(".0"))
        results.append(result)
    results.sort(key=lambda result: result.rank)
    _refuse_ranks(row.file, results)
    _refuse_duels(row, results)
    if row.racers is not None and row.racers != len(results):
        raise UserFault("import_row_count", file=row.file, found=len(results), listed=row.racers)
    kept = [name for name in heading if name in RESULT_COLUMNS]
    return ReadRace(row, kept, sorted(pointed - {"AvgResets"}), results, number)


def _refuse_ranks(file: str, results: Sequence[ResultRow]) -> None:
    """A better rank never has a worse score; equal scores may have ranks in any order."""
    for better, worse in pairwise(results):
        if better.score > worse.score or (better.rank == worse.rank and better.score != worse.score):
            raise UserFault(
                "import_rank",
                file=file,
                row=worse.row,
                rank=worse.rank,
                score=worse.score,
                other_rank=better.rank,
                other_score=better.score,
            )


def _refuse_duels(row: RaceRow, results: Sequence[ResultRow]) -> None:
    """Scores of duels stand in a head-to-head race without bots; there is one format, and each seed once."""
    seeds: set[int] = set()
    formats = {(one.duel.bracket, one.duel.cars) for one in results if one.duel is not None}
    for one in results:
        if one.duel is None:
            continue
        wrong = row.race_type != RaceType.HEAD_TO_HEAD or row.bots or len(formats) > 1 or one.duel.seed in seeds
        if wrong:
            expected = (
                "a time, for only a race of cars against cars has scores of duels, in one format and each seed once"
            )
            cells = {"RankingScore": str(one.score)}
            raise Cells(row.file, one.row, cells).refuse("RankingScore", expected)
        if one.duel.seed is not None:
            seeds.add(one.duel.seed)


def _refuse_files(folder: Path, rows: Sequence[RaceRow]) -> None:
    root, seen = folder.resolve(), set()
    for row in rows:
        try:
            path = (folder / row.file).resolve()
        except (OSError, RuntimeError):  # a link that leads to itself, before Python 3.13
            path = None
        if path is None or path.is_symlink() or not path.is_relative_to(root):
            raise UserFault("import_path", row=row.row, file=row.file)
        if path in seen or path == root / INDEX:
            raise UserFault("import_file_twice", row=row.row, file=row.file)
        seen.add(path)


def _numbers(rows: Sequence[RaceRow]) -> dict[int, int]:
    """The number of each row's round. Races of the same name are one round as far as their stages differ, and a finale
    is of the last pro race of its name that closed before it, or without one of its name of the last pro race that
    closed before it and has no finale yet, or else opened before it; single races are rounds of their own. Numbered as
    they open."""
    rounds: list[dict[Stage, RaceRow]] = []
    for row in sorted(rows, key=lambda row: (row.opens_at, row.stage == Stage.FINALE, row.row)):
        missing = [one for one in rounds if row.stage not in one]
        same = [one for one in missing if Stage.SINGLE not in one and next(iter(one.values())).name == row.name]
        if row.stage == Stage.FINALE:
            pros = [one for one in missing if Stage.PRO in one]
            closed = [one for one in pros if one[Stage.PRO].closes_at <= row.opens_at]
            opened = [one for one in pros if one[Stage.PRO].opens_at <= row.opens_at]
            same = [one for one in closed if one in same] or same or closed or opened
        if row.stage == Stage.SINGLE or not same:
            rounds.append({row.stage: row})
        else:
            same[-1][row.stage] = row
    return {row.row: number for number, one in enumerate(rounds, start=1) for row in one.values()}


def _rows(folder: Path, file: str, needed: Sequence[str]) -> tuple[list[str], Iterator[tuple[int, Mapping[str, str]]]]:
    """The heading of a file and its rows by column, numbered from 2. Raises UserFault for an invalid table."""
    try:
        text = _bytes(folder, file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserFault("import_not_text", file=file, problem=error.reason) from None
    reader = csv.reader(StringIO(text, newline=""), strict=True)
    try:
        table = list(reader)
    except csv.Error as error:
        raise UserFault("import_not_text", file=file, problem=str(error)) from None
    heading = [name.strip() for name in table[0]] if table else []
    missing = [name for name in needed if name not in heading]
    if missing:
        raise UserFault("import_columns", file=file, columns=", ".join(missing))
    twice = [name for name in dict.fromkeys(heading) if name and heading.count(name) > 1]
    if twice:
        raise UserFault("import_not_text", file=file, problem=f"the column {', '.join(twice)} is there twice")
    return heading, _cells(file, heading, table)


def _cells(file: str, heading: list[str], table: list[list[str]]) -> Iterator[tuple[int, Mapping[str, str]]]:
    for number, row in enumerate(table[1:], start=2):
        if not row:
            continue
        if len(row) != len(heading):
            raise UserFault("import_cells", file=file, row=number, found=len(row), columns=len(heading))
        yield number, dict(zip(heading, row, strict=True))


def _bytes(folder: Path, file: str) -> bytes:
    path = folder / file
    try:
        if path.is_file():  # not a pipe, which would be waited for
            return path.read_bytes()
    except (OSError, ValueError):
        pass
    raise UserFault("import_no_folder", file=str(path))
