"""Recorded seasons by command, and the way back: an export is what was imported."""

from __future__ import annotations

import json
from io import StringIO

import pytest
from django.core.management import CommandError, call_command
from django.db import transaction

from league.history.folder_reader import read_folder
from league.history.proof import proof_of
from league.history.season_export import export_season
from league.models import (
    Round,
    Season,
)
from league.stewarding.official_results import close_due_rounds
from races.boards.selectors.board import board
from races.models import Entry, Race
from races.ranks import NOT_CLASSIFIED
from tests.factories import a_racer
from tests.league import seasons
from tests.league.histories import START, read_csv, write_csv
from tests.league.records import RESULTS, bring, contents

pytestmark = pytest.mark.django_db


# --- the commands ----------------------------------------------------------------------------------------------------


def run(*arguments: object, **options) -> str:
    out = StringIO()
    call_command(*map(str, arguments), stdout=out, stderr=StringIO(), **options)
    return out.getvalue()


def test_importing_prints_the_same_agreement_again(folder):
    first = run("import_season", folder, "--season", "2031", "--json")
    data = json.loads(first)
    assert data["order"]["pairs"] == data["order"]["agree"] and data["championship"] == 2
    assert run("import_season", folder, "--season", "2031", "--json") == first
    assert "promotion: 3 of 4 agree" in run("import_season", folder)


def test_agreement_is_summed_over_several_seasons(folder):
    rows = read_csv(folder / "races.csv")
    rows[0]["season"] = "2030"
    write_csv(folder / "races.csv", list(rows[0]), rows)
    data = json.loads(run("import_season", folder, "--json"))
    assert (data["races"], data["results"], len(data["seasons"])) == (3, 37, 2)


@pytest.mark.parametrize(
    "arguments, code",
    [
        (("--cut", "100"), "season_cut"),
        (("--cut", "0"), "season_cut"),
        *((("--cut", value), "season_cut") for value in ("nan", "snan", "inf")),
        (("--points", "1,2"), "season_points_rise"),
        (("--points", "one"), "season_points_shape"),
        (("--season", "1999"), "import_no_season"),
    ],
)
def test_the_command_refuses_with_a_code(folder, arguments, code):
    with pytest.raises(CommandError, match=f"^{code}: "):
        run("import_season", folder, *arguments)
    assert not Season.objects.exists()


def test_exporting_needs_a_season_and_an_empty_folder(folder, tmp_path):
    with pytest.raises(CommandError, match=r"There is no season x\. There is: none"):
        run("export_season", "x", tmp_path / "new")
    run("import_season", folder)
    assert "3 races" in run("export_season", "2031", tmp_path / "new")
    with pytest.raises(CommandError, match=r"^export_folder_used: "):
        run("export_season", "2031", tmp_path / "new")


# --- the way back ----------------------------------------------------------------------------------------------------


def test_an_export_equals_the_import_byte_for_byte(folder, tmp_path):
    (season,) = bring(folder)
    export_season(season=season, folder=tmp_path / "out")
    assert contents(tmp_path / "out") == contents(folder)


def test_a_disqualified_racer_is_not_exported(folder, tmp_path):
    (season,) = bring(folder)
    Entry.objects.filter(racer__alias="racer-00002").update(withdrawn_at=START, removed_at=START)
    export_season(season=season, folder=tmp_path / "out")
    rows = read_csv(tmp_path / "out" / RESULTS)
    assert [(row["Alias"], row["Rank"]) for row in rows[:2]] == [("racer-00001", "1"), ("racer-00003", "2")]
    assert read_csv(tmp_path / "out" / "races.csv")[0]["racers"] == "29" == str(len(rows))
    read_folder(tmp_path / "out")


def test_a_season_raced_here_survives_export_and_import(tmp_path, wakes):
    season = seasons.a_season()
    january, pro = seasons.a_round(season, 1, "open-qualifier"), seasons.a_round(season, 1, "pro-qualifier")
    upcoming = seasons.a_round(season, 2, "open-qualifier", ranking_method="total")
    ten = seasons.racers(10)
    seasons.board(january.race, ten, sectors=[1, 2, 3], total_ms=90_000, last_number=4, submission_count=4)
    tied = seasons.racers(2)
    seasons.board(january.race, tied[::-1][:1], first_ms=30_000, total_ms=90_000)
    seasons.stand(january.race, tied[0], 30_000, total_ms=90_000, resets=3, off_tracks=2)
    Entry.objects.create(race=january.race, racer=a_racer())
    Entry.objects.create(
        race=january.race, racer=a_racer(), rank_score=NOT_CLASSIFIED - 120, achieved_at=january.race.opens_at
    )
    seasons.board(january.race, [a_racer(is_house=True)], is_baseline=True, first_ms=1)
    close_due_rounds(now=seasons.after(january))
    left_out = export_season(season=season, folder=tmp_path / "out")
    assert left_out == [upcoming] and pro.race.entries.count() == 0
    first = contents(tmp_path / "out")
    assert len(first) == 3
    rows = read_csv(tmp_path / "out" / next(name for name in first if "open" in name))
    assert len(rows) == 13, "neither the house car nor who has no result"
    order = [row["Alias"] for row in rows]
    with transaction.atomic():
        Round.objects.all().delete()
        Race.objects.all().delete()
        season.delete()
        (back,) = bring(tmp_path / "out")
        race = Race.objects.get(round__season=back, round__stage="open-qualifier")
        assert [row.entry.record.alias for row in board(race).rows] == order
        assert proof_of(back)["order"]["pairs"] == proof_of(back)["order"]["agree"] > 0
        export_season(season=back, folder=tmp_path / "again")
    assert contents(tmp_path / "again") == first
