"""A round of duels leaves as a record and comes back with its order, its qualifying times and what came of it."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from django.db import transaction

from league.models import Round, RoundPoints
from league.selectors.proof import proof_of
from league.services import close_due_rounds, create_season
from league.services.exporting import export_season
from league.services.importing import import_folder
from races.models import Entry, Race
from races.selectors import board
from races.services import draw_duels, drive_on
from tests.duels import a_duel_race, end_all, qualify
from tests.factories import a_racer
from tests.league.histories import read_csv

pytestmark = pytest.mark.django_db


def standings() -> list[tuple]:
    return list(RoundPoints.objects.order_by("rank", "racer__alias").values_list("rank", "racer__alias", "points"))


def test_a_round_of_duels_comes_back_in_the_order_of_its_points(now, tmp_path, bell):
    season = create_season(slug="duels", name="Duels", starts_on=date(2020, 1, 1), ends_on=date(2040, 1, 1))
    race = a_duel_race(now, kind="league", division="all", organiser=None)
    Round.objects.create(season=season, number=1, race=race)
    qualify(race, [a_racer(f"car-{number}") for number in range(1, 5)], now)
    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    end_all(race, race.closes_at, max)
    close_due_rounds(now=race.closes_at + timedelta(days=1))
    ours = [(row.rank, row.alias, row.entry.average_ms) for row in board(race).rows]
    assert ours[0][1] != "car-1" and len(ours) == 4, "who wins duels is not who was fast in qualifying"
    points = standings()

    assert export_season(season=season, folder=tmp_path / "out") == []
    (row,) = read_csv(tmp_path / "out" / "races.csv")
    assert (row["race_type"], row["bots"], row["stage"]) == ("head_to_head_racing", "", "single")
    assert [one["RankingScore"] for one in read_csv(tmp_path / "out" / row["file"])] == ["1", "2", "3", "4"]
    with transaction.atomic():
        Round.objects.all().delete()
        Race.objects.all().delete()
        season.delete()
        (back,) = import_folder(folder=tmp_path / "out", now=now)
    again = Race.objects.get(round__season=back)
    rows = board(again).rows
    assert [(row.rank, row.entry.record.alias, row.entry.average_ms) for row in rows] == ours
    assert [(rank, points) for rank, _alias, points in standings()] == [(rank, won) for rank, _alias, won in points]
    proof = proof_of(back)
    assert proof["order"] == {"pairs": 6, "agree": 6}
    assert proof["scores"] == {"checked": 4, "agree": 0}, "a place is no time, and nobody says it is"
    assert not Entry.objects.filter(race=again, seed__isnull=False).exists()
    export_season(season=back, folder=tmp_path / "again")
    for path in (tmp_path / "out").rglob("*.csv"):
        assert (tmp_path / "again" / path.relative_to(tmp_path / "out")).read_bytes() == path.read_bytes()
