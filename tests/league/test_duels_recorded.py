"""A round of duels leaves as a record and comes back with its order, its qualifying times and what came of it."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from django.db import transaction
from hypothesis import given
from hypothesis import strategies as st

from league.history.columns import FIRST_OF_DUELS, LAST_OF_DUELS, DuelScore, read_duel_score
from league.history.proof import proof_of
from league.history.season_export import export_season
from league.history.season_import import import_folder
from league.models import Round, RoundPoints
from league.seasons.services.seasons import create_season
from league.stewarding.official_results import close_due_rounds
from races.boards.selectors.board import board
from races.duels.services import draw_duels, drive_on
from races.models import Entry, Race
from tests.duels import a_duel_race, end_all, qualify
from tests.factories import a_racer
from tests.league.histories import read_csv

pytestmark = pytest.mark.django_db


def standings() -> list[tuple]:
    return list(RoundPoints.objects.order_by("rank", "racer__alias").values_list("rank", "racer__alias", "points"))


def driven(entry: Entry) -> tuple:
    """What the board of a race of duels shows of a car."""
    duels = entry.seed, entry.points, entry.duels, entry.duel_lap_ms
    return entry.score_ms, entry.average_ms, entry.best_lap_ms, entry.rank_score, entry.rank_lap, *duels


@given(
    st.booleans(),
    st.integers(2, 9),
    st.one_of(
        st.builds(dict, time_ms=st.integers(0, 2**31 - 1)),
        st.builds(
            dict,
            seed=st.integers(1, 127),
            points=st.integers(0, 32_767),
            duels=st.integers(0, 1023),
            lap_ms=st.none() | st.integers(0, 1_999_999),
        ),
    ),
)
def test_a_duel_score_encodes_what_went_into_it(bracket, cars, what):
    score = DuelScore(bracket, cars, **what)
    assert FIRST_OF_DUELS <= score.number <= LAST_OF_DUELS and read_duel_score(score.number) == score


@given(st.integers(FIRST_OF_DUELS, LAST_OF_DUELS))
def test_an_impossible_duel_score_is_not_read(number):
    read = read_duel_score(number)
    assert read is None or read.number == number


@pytest.mark.parametrize(
    "first, second",
    [
        ({"seed": 2, "points": 5, "lap_ms": 9_000}, {"seed": 1, "points": 4, "lap_ms": 8_000}),
        ({"seed": 2, "points": 4, "lap_ms": 8_000}, {"seed": 1, "points": 4, "lap_ms": 8_001}),
        ({"seed": 2, "points": 4, "lap_ms": 8_000}, {"seed": 1, "points": 4, "lap_ms": None}),
        ({"seed": 1, "points": 4, "lap_ms": 8_000, "duels": 9}, {"seed": 2, "points": 4, "lap_ms": 8_000}),
        ({"seed": 99, "points": 0, "lap_ms": None}, {"time_ms": 1}),
        ({"time_ms": 1}, {"time_ms": 2}),
    ],
)
def test_duel_scores_sort_in_board_order(first, second):
    assert DuelScore(False, 2, **first).number < DuelScore(False, 2, **second).number < 2**62


def test_an_imported_round_of_duels_keeps_its_order_of_points(now, tmp_path, wakes):
    season = create_season(slug="duels", name="Duels", starts_on=date(2020, 1, 1), ends_on=date(2040, 1, 1))
    race = a_duel_race(now, kind="league", division="all", organiser=None)
    Round.objects.create(season=season, number=1, race=race)
    qualify(race, [a_racer(f"car-{number}") for number in range(1, 5)], now)
    draw_duels(race=race, now=race.closes_at)
    drive_on(race=race, now=race.closes_at)
    end_all(race, race.closes_at, max)
    close_due_rounds(now=race.closes_at + timedelta(days=1))
    ours = [(row.rank, row.alias, *driven(row.entry)) for row in board(race).rows]
    assert ours[0][1] != "car-1" and len(ours) == 4, "who wins duels is not who was fast in qualifying"
    points = standings()

    assert export_season(season=season, folder=tmp_path / "out") == []
    (row,) = read_csv(tmp_path / "out" / "races.csv")
    assert (row["race_type"], row["bots"], row["stage"]) == ("head_to_head_racing", "", "single")
    scores = [int(one["RankingScore"]) for one in read_csv(tmp_path / "out" / row["file"])]
    assert scores == sorted(scores) and scores[0] > 2**61 and scores[-1] < 2**62, "neither times nor places"
    with transaction.atomic():
        Round.objects.all().delete()
        Race.objects.all().delete()
        season.delete()
        (back,) = import_folder(folder=tmp_path / "out", now=now)
    again = Race.objects.get(round__season=back)
    rows = board(again).rows
    assert [(row.rank, row.entry.record.alias, *driven(row.entry)) for row in rows] == ours
    assert (again.opponents, again.duel_format, again.duel_cars) == (race.opponents, race.duel_format, race.duel_cars)
    assert [(rank, points) for rank, _alias, points in standings()] == [(rank, won) for rank, _alias, won in points]
    proof = proof_of(back)
    assert proof["order"] == {"pairs": 6, "agree": 6}
    assert proof["scores"] == {"checked": 4, "agree": 0}, "a place is no time, and nobody says it is"
    export_season(season=back, folder=tmp_path / "again")
    for path in (tmp_path / "out").rglob("*.csv"):
        assert (tmp_path / "again" / path.relative_to(tmp_path / "out")).read_bytes() == path.read_bytes()
