"""The export of a season to a folder that :mod:`league.history.season_import` can read."""

import csv
import hashlib
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from paddock.errors import UserFault
from races.boards.ranking import RULES, laps_needed
from races.boards.selectors.board import ORDER, board_entries
from races.models import DuelFormat, Entry, Race
from races.ranks import NO_RESULT, NOT_CLASSIFIED

from ..models import RecordedRace, RecordedResult, Round, Season, Stage
from .columns import (
    BOT_COLUMNS,
    LAPS_COLUMNS,
    PENALTY_COLUMNS,
    RACE_COLUMNS,
    RACE_TYPES,
    RESULT_COLUMNS,
    WORST_SCORE,
    DuelScore,
    milliseconds_of,
)
from .folder_reader import INDEX

Row = dict[str, str | int | float | None]  # the cells of a row by column
_RACE_TYPES = {value: word for word, value in RACE_TYPES.items()}
# what the old service leaves empty for a car that was not classified, and then writes with a decimal point
_TIMES = ("AvgLapTime", "BestLapTime", "TotalLapTime")


def export_season(*, season: Season, folder: Path) -> list[Round]:
    """Write the official rounds of a season to a new or empty ``folder``; returns the rounds left out.

    An imported race is written as recorded, without racers disqualified since. House cars and cars without any result
    are left out. Raises UserFault("export_folder_used").
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserFault("export_folder_used", folder=str(folder))
    (folder / "results").mkdir(parents=True, exist_ok=True)
    rounds = list(
        season.rounds.filter(race__cancelled_at=None).select_related("race__track", "race__record", "season__record")
    )
    official = sorted((one for one in rounds if one.closed_at is not None), key=_position)
    rows = []
    for round_ in official:
        results = list(_results(round_))
        row = _race_row(round_, len(results))
        _write(folder / str(row["file"]), _heading(round_), results)
        rows.append(row)
    _write(folder / INDEX, RACE_COLUMNS, rows)
    return [one for one in rounds if one.closed_at is None]


def _position(round_: Round) -> tuple:
    record = _record(round_.race)
    return (0 if record else 1, record.position if record else 0, round_.race.opens_at, round_.number, round_.pk)


def _record(race: Race) -> RecordedRace | None:
    return getattr(race, "record", None)


def _write(path: Path, heading: Iterable[str], rows: Iterable[Row]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(heading), extrasaction="ignore", lineterminator="\r\n")
        writer.writeheader()
        writer.writerows(rows)


def _race_row(round_: Round, racers: int) -> Row:
    race, record = round_.race, _record(round_.race)
    if record is not None:
        return record.row | {"racers": racers}
    boxes = len(race.boxes) or race.random_boxes
    return {
        "file": _file_of(round_),
        "season": round_.season.slug,
        "name": round_.name or f"Round {round_.number}",
        "stage": round_.stage,
        "division": "" if round_.stage == Stage.SINGLE else race.division,
        "race_type": _RACE_TYPES[race.race_type],
        "timing_method": RULES[race.ranking_method].record,
        **dict(zip(LAPS_COLUMNS, (laps_needed(race), race.laps), strict=True)),
        "opens": _iso(race.opens_at),
        "closes": _iso(race.closes_at),
        **{column: getattr(race, name) / 1000 for name, column in PENALTY_COLUMNS.items()},
        **dict.fromkeys(BOT_COLUMNS, ""),
        **({name: float(getattr(race, name)) for name in BOT_COLUMNS} if race.bots else {}),
        "obstacles": float(boxes) if boxes else "",
        "track": race.track.slug,
        "racers": racers,
    }


def _file_of(round_: Round) -> str:
    race = round_.race
    key = hashlib.sha256(race.slug.encode()).hexdigest()[:8]
    return f"results/{race.opens_at.astimezone(UTC):%Y-%m-%d}-{round_.stage}-{key}.csv"


def _iso(moment: datetime) -> str:
    return moment.astimezone(UTC).isoformat()


def _heading(round_: Round) -> list[str]:
    record = _record(round_.race)
    if record is not None:
        return record.heading
    single = round_.stage == Stage.SINGLE
    return [name for name in RESULT_COLUMNS if not (single and name == "RacingDivision")]


def _results(round_: Round) -> Iterator[Row]:
    race, record = round_.race, _record(round_.race)
    entries = board_entries(race).filter(is_baseline=False, rank_score__lt=NO_RESULT)
    if record is None:
        driven = list(entries.select_related("racer", "best__evaluation__result"))
        drawn = any(entry.seed is not None for entry in driven)
        rows = [_driven_row(entry, race) | (_duel_score(entry, race) if drawn else {}) for entry in driven]
        empty = [name for name in _TIMES if any(row[name] == "" for row in rows)]
    else:
        first, *ties = ORDER
        entries = entries.select_related("racer", "record").order_by(first, "record__rank", *ties)
        rows = [_recorded_row(entry, entry.record) for entry in entries]
        empty = record.decimals
    whole = record is not None and RecordedResult.objects.filter(entry__race=race).count() == len(rows)
    for place, row in enumerate(rows, start=1):
        row["Rank"] = row["rank"] if whole else place
        for name in empty:
            if isinstance(time := row[name], int | float):
                row[name] = float(time)
        yield row


def _sent(entry: Entry) -> int:
    assert entry.achieved_at is not None, "it has a result"
    return milliseconds_of(entry.achieved_at)


def _driven_row(entry: Entry, race: Race) -> Row:
    laps = entry.best.evaluation.result.laps if entry.best is not None else []
    times: Row = dict.fromkeys(_TIMES, "")
    score: int | None = WORST_SCORE - (NOT_CLASSIFIED - entry.rank_score)
    if entry.classified:
        total = entry.total_ms if entry.total_ms is not None else sum(lap["time_ms"] for lap in laps)
        times.update(zip(_TIMES, (entry.average_ms, entry.best_lap_ms, total), strict=True))
        score = entry.score_ms
    return times | {
        "Alias": entry.racer.shown_name,
        "SubmissionTime": _sent(entry),
        "LapCount": laps_needed(race) if entry.classified else 0,
        "AvgResets": entry.resets / len(laps) if laps else 0.0,
        "CollisionCount": sum(lap["crashes"] for lap in laps),
        "OffTrackCount": entry.off_tracks,
        "ResetCount": entry.resets,
        "SubmissionCount": entry.submission_count,
        "LeaderboardSubmissionStatusType": "SUCCESS",
        "RankingScore": score,
        "RacingDivision": race.division.upper(),
        "UserId": entry.racer.record_id or entry.racer.alias,
    }


def _duel_score(entry: Entry, race: Race) -> Row:
    """The score of a car in a race of duels; cars that are not classified have none."""
    if not entry.classified:
        return {}
    bracket = race.duel_format == DuelFormat.BRACKET
    won = entry.seed, entry.points, entry.duels, entry.duel_lap_ms
    score = DuelScore(bracket, race.duel_cars, *won, time_ms=entry.score_ms if entry.seed is None else None)
    return {"RankingScore": score.number}


def _recorded_row(entry: Entry, record: RecordedResult) -> Row:
    row: Row = {
        "Alias": record.alias,
        "SubmissionTime": _sent(entry),
        "LapCount": entry.complete_laps,
        "AvgLapTime": entry.average_ms,
        "BestLapTime": entry.best_lap_ms,
        "TotalLapTime": entry.total_ms,
        "AvgResets": record.average_resets,
        "CollisionCount": record.collisions,
        "OffTrackCount": entry.off_tracks,
        "ResetCount": entry.resets,
        "SubmissionCount": entry.submission_count,
        "LeaderboardSubmissionStatusType": record.status,
        "RankingScore": record.score,
        "RacingDivision": record.division,
        "UserId": entry.racer.record_id,
        "rank": record.rank,
    }
    return row | dict.fromkeys(record.blank, "")
