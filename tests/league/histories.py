"""Folders of recorded seasons that a test makes up."""

from __future__ import annotations

import csv
import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from league.history.columns import RACE_COLUMNS, RESULT_COLUMNS, WORST_SCORE

START = datetime(2031, 1, 1, tzinfo=UTC)


@dataclass
class Recorded:
    """One race of a record. ``scores``: racers' numbers and times in milliseconds, None for who was not classified."""

    stage: str
    name: str
    opens: datetime
    closes: datetime
    scores: list[tuple[int, int | None]]
    fields: dict[str, Any] = field(default_factory=dict)

    @property
    def file(self) -> str:
        return f"results/{self.opens:%Y-%m-%d}-{self.stage}-{self.name.replace(' ', '')}.csv"


def month(number: int, stage: str, scores: Iterable[tuple[int, int | None]], **fields: Any) -> Recorded:
    """A race of month ``number`` (from 0): open and pro races last 28 days, a finale is five hours two weeks later."""
    opens = START + timedelta(days=28 * number)
    closes = opens + timedelta(days=28)
    if stage == "pro-finale":
        opens = closes + timedelta(days=10)
        closes = opens + timedelta(hours=5)
    return Recorded(stage, f"Month {number + 1}", opens, closes, list(scores), fields)


def write_season(folder: Path, races: Sequence[Recorded], label: str = "2031") -> Path:
    """Write a folder as ``import_season`` reads it; returns it."""
    (folder / "results").mkdir(parents=True, exist_ok=True)
    rows = [_race_row(race, label) for race in races]
    write_csv(folder / "races.csv", RACE_COLUMNS, rows)
    for race in races:
        write_csv(folder / race.file, RESULT_COLUMNS, result_rows(race))
    return folder


def write_csv(path: Path, heading: Sequence[str], rows: Iterable[dict[str, Any]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, heading)
        writer.writeheader()
        writer.writerows(rows)


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def _race_row(race: Recorded, label: str) -> dict[str, Any]:
    return {
        "file": race.file,
        "season": label,
        "name": race.name,
        "stage": race.stage,
        "division": {"open-qualifier": "open", "single": ""}.get(race.stage, "pro"),
        "race_type": "time_trial",
        "timing_method": "best_lap_time" if race.stage == "pro-finale" else "total_time",
        "minimum_laps": 1 if race.stage == "pro-finale" else 3,
        "maximum_laps": 15 if race.stage == "pro-finale" else 3,
        "opens": race.opens.isoformat(),
        "closes": race.closes.isoformat(),
        "off_track_penalty_s": "3.0",
        "collision_penalty_s": "5.0",
        "bots": "",
        "bot_speed_mps": "",
        "obstacles": "",
        "track": "some_track",
        "racers": len(race.scores),
    } | race.fields


def result_rows(race: Recorded) -> list[dict[str, Any]]:
    """The rows of a race's results in the order of their scores; equal ones as they came."""
    best = race.stage == "pro-finale"
    ranked = sorted(race.scores, key=lambda one: WORST_SCORE if one[1] is None else one[1])
    missing = any(score is None for _racer, score in ranked)
    rows = []
    for rank, (racer, score) in enumerate(ranked, start=1):
        times: tuple = ("", "", "")
        if score is not None:
            lap = score if best else score // 3
            times = (lap, lap, score * 3 if best else score)
            times = tuple(map(float, times)) if missing else times
        submitted = int(race.opens.timestamp()) * 1000 + 1000 * racer + rank
        rows.append(
            dict(zip(("AvgLapTime", "BestLapTime", "TotalLapTime"), times, strict=True))
            | {
                "Alias": f"racer-{racer:05}",
                "SubmissionTime": submitted,
                "LapCount": 0 if score is None else 1 if best else 3,
                "AvgResets": 0.0 if score is None else racer % 7 / 3,
                "CollisionCount": 0,
                "OffTrackCount": racer % 7,
                "ResetCount": racer % 7,
                "SubmissionCount": 1 + racer % 50,
                "Rank": rank,
                "LeaderboardSubmissionStatusType": "SUCCESS",
                "RankingScore": WORST_SCORE - racer % 100 if score is None else score,
                "RacingDivision": "OPEN",
                "UserId": f"racer-{racer:05}",
            }
        )
    if missing:  # those who were not classified stand in the order of their scores too
        rows.sort(key=lambda row: (row["RankingScore"], row["Rank"]))
        for rank, row in enumerate(rows, start=1):
            row["Rank"] = rank
    return rows


def random_season(seed: int, months: int = 3, racers: int = 40) -> list[Recorded]:
    """A season in which anybody may turn up anywhere, with many equal scores and cars that were not classified."""
    chance = random.Random(seed)

    def scores(most: int) -> list[tuple[int, int | None]]:
        who = chance.sample(range(1, racers + 1), chance.randint(0, min(most, racers)))
        return [(one, chance.choice((None, 30_000, 31_000, chance.randint(20_000, 90_000)))) for one in who]

    races = [month(chance.randint(20, 30), "single", scores(racers), name="Warm up")] if chance.random() < 0.5 else []
    for number in range(months):
        stages = ["open-qualifier", "pro-qualifier", "pro-finale"]
        for stage in stages if chance.random() < 0.8 else chance.sample(stages, 2):
            races.append(month(number, stage, scores(10 if stage == "pro-finale" else racers)))
    chance.shuffle(races)
    return races
