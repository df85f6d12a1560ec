"""Seasons that a league like the real one could have had: raced by the test with rules of its own, written down in the
form of the record, and imported. The command must say of each of them what it says of the season of 2022.

The rules are here a second time on purpose, in whole numbers and plain lists, and share nothing with
``league.standings.rules``.
"""

from __future__ import annotations

import json
import random
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from io import StringIO
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from django.core.management import call_command

from league.models import ChampionshipPlace, FinalePlace, Membership
from tests.league.histories import write_csv
from tests.soak import some

pytestmark = pytest.mark.django_db

RACES = (
    *("file", "season", "name", "stage", "division", "race_type", "timing_method", "minimum_laps", "maximum_laps"),
    *("opens", "closes", "off_track_penalty_s", "collision_penalty_s", "bots", "bot_speed_mps", "obstacles"),
    *("track", "racers"),
)
RESULTS = (
    *("Alias", "SubmissionTime", "LapCount", "AvgLapTime", "BestLapTime", "TotalLapTime", "AvgResets"),
    *("CollisionCount", "OffTrackCount", "ResetCount", "SubmissionCount", "Rank"),
    *("LeaderboardSubmissionStatusType", "RankingScore", "RacingDivision", "UserId"),
)
DIVISIONS = {"open-qualifier": "open", "single": ""}
NAMES = ("January", "February", "March", "April", "May", "June", "July")


@dataclass
class Drive:
    """What a racer of the made-up league achieved in a race. ``laps``: three lap times in ms; none: disqualified."""

    racer: str
    laps: list[int]
    resets: int
    sent: int  # milliseconds since 1970
    progress: int = 0

    def score(self, method: str) -> int:
        if not self.laps:
            return 9_223_372_036_854_775_807 - self.progress
        return {"total_time": sum(self.laps), "best_lap_time": min(self.laps), "avg_lap_time": sum(self.laps) // 3}[
            method
        ]


@dataclass
class Event:
    """A race of the made-up league with the drives in it."""

    stage: str
    name: str
    opens: datetime
    closes: datetime
    method: str
    drives: list[Drive] = field(default_factory=list)

    def order(self) -> list[str]:
        """The classified, the best first: score, then best lap, then resets, then who sent it in earlier."""
        ranked = [(one.score(self.method), min(one.laps), one.resets, one.sent, one) for one in self.drives if one.laps]
        return [one[-1].racer for one in sorted(ranked, key=lambda one: one[:-1])]

    def scores(self) -> list[int]:
        return [one.score(self.method) for one in self.drives]


class League:
    """A league that races ``months`` months and keeps its own books: ``promoted`` (month by racer), ``fields`` (the
    finalists by month) and ``qualified`` (month and racer in order)."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.racers = [f"racer-{number:04}" for number in range(self.chance.randint(60, 220))]
        self.skill = {racer: self.chance.gauss(11_000, 900) for racer in self.racers}
        self.promoted: dict[str, int] = {}
        self.fields: dict[int, list[str]] = {}
        self.qualified: list[tuple[int, str]] = []
        self.events: list[Event] = []
        self.months = self.chance.randint(3, 6)
        for month in range(self.months):
            self._race_month(month)
        self._race_championship()

    def _race_month(self, month: int) -> None:
        chance, opens = self.chance, datetime(2033, 1 + month, 1, tzinfo=UTC)
        closes = datetime(2033, 2 + month, 1, tzinfo=UTC) - timedelta(seconds=1)
        method = chance.choice(("total_time", "total_time", "avg_lap_time"))
        name = f"{NAMES[month]} Qualifier"
        pros = [racer for racer in self.promoted if chance.random() < 0.8]
        newcomers = [racer for racer in self.racers if racer not in self.promoted and chance.random() < 0.7]
        open_race = self._event("open-qualifier", name, opens, closes, method, newcomers)
        pro_race = self._event("pro-qualifier", name, opens, closes, method, pros) if pros else None
        if chance.random() < 0.4:  # anybody's, at the same time as the others
            self._event("single", f"{NAMES[month]} Cup", opens, closes, "best_lap_time", chance.sample(self.racers, 20))
        if month and self.fields.get(month - 1):  # last month's finale is in the second week of this one
            self._race_finale(month - 1, opens + timedelta(days=9, hours=14))
        best = open_race.order()
        for racer in best[: max(1, (len(best) + 5) // 10)]:
            self.promoted[racer] = month
        if pro_race is not None:
            champions = {racer for _month, racer in self.qualified}
            self.fields[month] = [racer for racer in pro_race.order() if racer not in champions][:16]

    def _race_finale(self, month: int, opens: datetime) -> None:
        there = [racer for racer in self.fields[month] if self.chance.random() < 0.95]
        finale = self._event(
            "pro-finale", f"{NAMES[month]} Qualifier", opens, opens + timedelta(hours=5), "best_lap_time", there
        )
        self.qualified += [(month, racer) for racer in finale.order()[:3]]

    def _race_championship(self) -> None:
        last = datetime(2033, 1 + self.months, 10, 14, tzinfo=UTC)
        if self.fields.get(self.months - 1):
            self._race_finale(self.months - 1, last)
        opens = last + timedelta(days=7)
        field_ = [racer for _month, racer in self.qualified]
        self._event("championship", "Championship", opens, opens + timedelta(days=2), "total_time", field_)

    def _event(self, stage: str, name: str, opens: datetime, closes: datetime, method: str, who: list[str]) -> Event:
        event = Event(stage, name, opens, closes, method)
        moments = self.chance.sample(range(int((closes - opens).total_seconds()) * 1000), len(who))
        for racer, moment in zip(who, moments, strict=True):
            event.drives.append(self._drive(racer, int(opens.timestamp()) * 1000 + moment))
        self.events.append(event)
        return event

    def _drive(self, racer: str, sent: int) -> Drive:
        """Somebody's best: now and then disqualified, and often as fast as others to the millisecond."""
        chance = self.chance
        if chance.random() < 0.06:
            return Drive(racer, [], 0, sent, progress=chance.randint(0, 120))
        grain = chance.choice((1, 200))
        laps = [max(7000, round(chance.gauss(self.skill[racer], 300) / grain) * grain) for _ in range(3)]
        return Drive(racer, laps, chance.randint(0, 3), sent)

    # --- as the record writes it

    def write(self, folder: Path) -> Path:
        (folder / "results").mkdir()
        rows = []
        for number, event in enumerate(self.events):
            file = f"results/{event.opens:%Y-%m-%d}-{event.stage}-{number}.csv"
            heading = [name for name in RESULTS if event.stage != "single" or name != "RacingDivision"]
            results = [{name: row[name] for name in heading} for row in self._results(event)]
            write_csv(folder / file, heading, results)
            rows.append(self._row(event, file))
        self.chance.shuffle(rows)
        write_csv(folder / "races.csv", RACES, rows)
        return folder

    def _row(self, event: Event, file: str) -> dict[str, Any]:
        head_to_head = event.stage == "pro-qualifier"
        return {
            "file": file,
            "season": "2033",
            "name": event.name,
            "stage": event.stage,
            "division": DIVISIONS.get(event.stage, "pro"),
            "race_type": "head_to_head_racing" if head_to_head else "time_trial",
            "timing_method": event.method,
            "minimum_laps": 3,
            "maximum_laps": self.chance.choice((3, "")),
            "opens": event.opens.isoformat(),
            "closes": event.closes.isoformat(),
            "off_track_penalty_s": "3.0",
            "collision_penalty_s": self.chance.choice(("3.0", "5.0", "")),
            "bots": "4.0" if head_to_head else "",
            "bot_speed_mps": "4.0" if head_to_head else "",
            "obstacles": "",
            "track": f"track_{event.opens:%m}",
            "racers": len(event.drives),
        }

    def _results(self, event: Event) -> list[dict[str, Any]]:
        """Ranked by score; the record breaks ties by chance, and a lap count is missing here and there."""
        drives = self.chance.sample(event.drives, len(event.drives))
        drives.sort(key=lambda one: one.score(event.method))
        rows = []
        for rank, one in enumerate(drives, start=1):
            times = (sum(one.laps) // 3, min(one.laps), sum(one.laps)) if one.laps else ("", "", "")
            rows.append(
                {
                    "Alias": one.racer,
                    "SubmissionTime": one.sent,
                    "LapCount": "" if self.chance.random() < 0.1 else len(one.laps),
                    **dict(zip(("AvgLapTime", "BestLapTime", "TotalLapTime"), times, strict=True)),
                    "AvgResets": one.resets / 3,
                    "CollisionCount": 0,
                    "OffTrackCount": one.resets,
                    "ResetCount": one.resets,
                    "SubmissionCount": self.chance.choice((1, 7, "")),
                    "Rank": rank,
                    "LeaderboardSubmissionStatusType": "SUCCESS",
                    "RankingScore": one.score(event.method),
                    "RacingDivision": "OPEN",
                    "UserId": one.racer,
                }
            )
        return rows


def proof_of(folder: Path) -> dict[str, Any]:
    out = StringIO()
    call_command("import_season", folder, "--season", "2033", "--json", stdout=out)
    return json.loads(out.getvalue())


@pytest.mark.parametrize("seed", some(range(12), 4))
def test_the_command_agrees_with_a_generated_league(tmp_path, seed):
    league = League(seed)
    proof = proof_of(league.write(tmp_path))

    assert proof["races"] == len(league.events)
    assert proof["results"] == sum(len(event.drives) for event in league.events)
    assert proof["racers"] == len({one.racer for event in league.events for one in event.drives})
    pairs = sum(a != b for event in league.events for a, b in combinations(event.scores(), 2))
    timed = sum(bool(one.laps) for event in league.events for one in event.drives)
    pros = sum(len(event.drives) for event in league.events if event.stage == "pro-qualifier")
    finalists = sum(len(event.drives) for event in league.events if event.stage == "pro-finale")
    assert proof["order"] == {"pairs": pairs, "agree": pairs}
    assert proof["scores"] == {"checked": timed, "agree": timed}
    assert proof["promotion"] == {"checked": pros, "agree": pros} and pros
    assert proof["finale"] == {"places": finalists, "agree": finalists} and finalists
    assert proof["championship"] == len(league.qualified) > 0
    assert proof["differences"] == {"promotion": [], "finale": []}

    promoted = Membership.objects.values_list("racer__alias", "promoted_in__name")
    assert dict(promoted) == {racer: f"{NAMES[month]} Qualifier" for racer, month in league.promoted.items()}
    fields = FinalePlace.objects.order_by("round__race__closes_at", "place").values_list("round__name", "racer__alias")
    assert list(fields) == [
        (f"{NAMES[month]} Qualifier", racer) for month, field_ in sorted(league.fields.items()) for racer in field_
    ]
    places = ChampionshipPlace.objects.order_by("round__race__closes_at", "place").values_list(
        "round__name", "racer__alias"
    )
    assert list(places) == [(f"{NAMES[month]} Qualifier", racer) for month, racer in league.qualified]


@pytest.mark.parametrize("seed", (3, 8))
def test_the_command_names_racers_no_rule_put_there(tmp_path, seed):
    """A proof that always agrees proves nothing: strangers in a pro race and in a finale are counted and named."""
    league = League(seed)
    pro = next(event for event in league.events if event.stage == "pro-qualifier")
    finale = next(event for event in reversed(league.events) if event.stage == "pro-finale")
    slowest = max(max(map(sum, (one.laps for one in event.drives))) for event in (pro, finale)) + 1000
    for name, event in (("never-promoted", pro), ("never-qualified", finale)):
        event.drives.append(Drive(name, [slowest] * 3, 9, int(event.closes.timestamp()) * 1000 - 1))
    proof = proof_of(league.write(tmp_path))

    assert proof["order"]["agree"] == proof["order"]["pairs"]
    assert proof["promotion"]["checked"] - proof["promotion"]["agree"] == 1
    assert proof["finale"]["places"] - proof["finale"]["agree"] == len(proof["differences"]["finale"]) >= 1
    assert [one["racer"] for one in proof["differences"]["promotion"]] == ["never-promoted"]
    assert "never-qualified" in [one["racer"] for one in proof["differences"]["finale"]]
