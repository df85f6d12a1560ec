"""Recorded seasons that are refused: nothing of them is imported, and the reason names file, row and column."""

from __future__ import annotations

from datetime import timedelta

import pytest

from tests.league import seasons
from tests.league.histories import START, month, read_csv, result_rows, write_csv, write_season
from tests.league.records import FEW, RESULTS, bring, change, refused

pytestmark = pytest.mark.django_db


@pytest.mark.parametrize(
    "column, value",
    [
        *((name, "-1") for name in ("AvgLapTime", "BestLapTime", "TotalLapTime", "RankingScore", "ResetCount")),
        *((name, "fast") for name in ("BestLapTime", "TotalLapTime", "SubmissionTime", "Rank", "AvgResets")),
        *((name, "") for name in ("RankingScore", "Rank", "Alias", "UserId", "SubmissionTime")),
        *((name, "1.5") for name in ("BestLapTime", "OffTrackCount")),
        *(("BestLapTime", value) for value in ("nan", "inf", "1e400", "99999999999999999999", "१२", "0x10", "1_0")),
        ("Rank", "0"),
        ("SubmissionCount", "40000"),
        ("RankingScore", "3000000000"),
        ("Alias", "a\nb"),
        ("UserId", "x" * 65),
    ],
)
def test_an_invalid_cell_is_refused_by_file_row_and_column(folder, column, value):
    change(folder, RESULTS, 5, **{column: value})
    params = refused(folder, "import_value")
    assert (params["file"], params["row"], params["column"]) == (RESULTS, 5, column)


@pytest.mark.parametrize(
    "column, value",
    [
        ("stage", "semi-finale"),
        ("race_type", "dragster"),
        ("timing_method", "worst_lap_time"),
        ("minimum_laps", "0"),
        ("maximum_laps", "2"),
        ("opens", "2031-01-01 00:00"),
        ("closes", "soon"),
        ("off_track_penalty_s", "-3"),
        ("bots", "some"),
        ("name", ""),
        ("season", ""),
    ],
)
def test_an_invalid_race_is_refused_by_row_and_column(folder, column, value):
    change(folder, "races.csv", 3, **{column: value})
    params = refused(folder, "import_value")
    assert (params["file"], params["row"], params["column"]) == ("races.csv", 3, column)


@pytest.mark.parametrize("column", ["BestLapTime", "Rank", "UserId"])
def test_a_missing_column_is_refused_by_name(folder, column):
    rows = read_csv(folder / RESULTS)
    write_csv(
        folder / RESULTS,
        [name for name in rows[0] if name != column],
        [{name: cell for name, cell in row.items() if name != column} for row in rows],
    )
    assert refused(folder, "import_columns") == {"file": RESULTS, "columns": column}
    rows = read_csv(folder / "races.csv")
    write_csv(folder / "races.csv", list(rows[0])[1:], [dict(list(row.items())[1:]) for row in rows])
    assert refused(folder, "import_columns") == {"file": "races.csv", "columns": "file"}


def test_a_racer_listed_twice_is_refused_naming_both_rows(folder):
    change(folder, RESULTS, 9, UserId="racer-00002")
    params = refused(folder, "import_duplicate_racer")
    assert (params["file"], params["row"], params["other"]) == (RESULTS, 9, 3)
    change(folder, RESULTS, 9, UserId="racer-00008", Alias="Racer-00002")
    assert refused(folder, "import_duplicate_racer")["row"] == 9


def test_a_rank_contradicting_the_score_is_refused(folder):
    change(folder, RESULTS, 5, Rank="5")
    change(folder, RESULTS, 6, Rank="4")
    params = refused(folder, "import_rank")
    assert (params["row"], params["rank"], params["score"]) == (5, 5, 34_000)
    change(folder, RESULTS, 5, Rank="4")
    change(folder, RESULTS, 6, Rank="4")
    assert refused(folder, "import_rank")["other_rank"] == 4


def test_an_incomplete_file_is_refused(folder):
    rows = read_csv(folder / RESULTS)
    write_csv(folder / RESULTS, list(rows[0]), rows[:-1])
    assert refused(folder, "import_row_count") == {"file": RESULTS, "found": 29, "listed": 30}


def test_a_race_that_closes_before_it_opens_is_refused(folder):
    change(folder, "races.csv", 2, opens=FEW[0].closes.isoformat(), closes=FEW[0].opens.isoformat())
    assert refused(folder, "import_times") == {"row": 2}


def test_single_races_may_overlap(tmp_path):
    write_season(
        tmp_path, [month(0, "single", [(1, 30_000)], name=f"Cup {n}", file=f"results/{n}.csv") for n in (1, 2)]
    )
    for number in (1, 2):
        write_csv(tmp_path / f"results/{number}.csv", list(result_rows(FEW[0])[0]), result_rows(FEW[0])[:1])
    assert len(bring(tmp_path)[0].rounds.all()) == 2


@pytest.mark.parametrize("file", ["../outside.csv", "/etc/passwd", "results/../../outside.csv"])
def test_files_outside_the_folder_are_not_read(folder, file):
    change(folder, "races.csv", 2, file=file)
    assert refused(folder, "import_path") == {"row": 2, "file": file}


def test_a_missing_repeated_or_malformed_file_is_refused(folder):
    change(folder, "races.csv", 2, file=FEW[1].file)
    assert refused(folder, "import_file_twice")["row"] == 3
    change(folder, "races.csv", 2, file="results/none.csv")
    assert refused(folder, "import_no_folder")["file"].endswith("results/none.csv")
    change(folder, "races.csv", 2, file=RESULTS)
    (folder / RESULTS).write_bytes(b"Alias\xff")
    assert refused(folder, "import_not_text")["file"] == RESULTS
    (folder / RESULTS).write_text('"Alias')
    refused(folder, "import_not_text")
    (folder / RESULTS).write_text("")
    refused(folder, "import_columns")


def test_a_row_of_the_wrong_length_is_refused(folder):
    with (folder / RESULTS).open("a") as file:
        file.write("racer-1,2,3\r\n")
    assert refused(folder, "import_cells") == {"file": RESULTS, "row": 32, "found": 3, "columns": 16}


def test_a_missing_season_is_refused_listing_existing_ones(folder, tmp_path):
    assert refused(folder, "import_no_season", season="1999") == {"season": "1999", "seasons": "2031"}
    refused(tmp_path / "nothing", "import_no_folder")
    rows = read_csv(folder / "races.csv")
    write_csv(folder / "races.csv", list(rows[0]), [])
    refused(folder, "import_empty")


def test_one_invalid_season_in_a_folder_imports_none(folder):
    rows = read_csv(folder / "races.csv")
    rows[2]["season"] = "2032"
    write_csv(folder / "races.csv", list(rows[0]), rows)
    seasons.create_season(slug="2032", name="x", starts_on=START.date(), ends_on=START.date() + timedelta(days=9))
    refused(folder, "import_season_exists")
    assert [one.slug for one in bring(folder, season="2031")] == ["2031"]
