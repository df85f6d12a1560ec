"""Folders that were broken on the way or made to do harm: refused with file, row and reason, or read as they are."""

from __future__ import annotations

import os
from datetime import timedelta
from pathlib import Path

import pytest

from accounts.models import Racer
from league.history.proof import proof_of
from league.history.season_import import import_folder
from league.models import Round, Season
from league.seasons.services.seasons import create_season
from paddock.errors import UserFault
from races.boards.selectors.board import board
from races.entries.services.entries import enter_race
from races.models import Entry, Race
from tests.league.histories import START, month, read_csv, write_csv, write_season
from tests.league.records import FEW, bring, change, everything, refused
from tests.races.test_concurrency import at_once
from tests.rows import track_row

pytestmark = pytest.mark.django_db

RESULTS = FEW[0].file


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_season(tmp_path / "record", FEW)


def rewritten(path: Path, call) -> None:
    path.write_bytes(call(path.read_bytes()))


# --- read as they are ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "written",
    [
        lambda data: b"\xef\xbb\xbf" + data,
        lambda data: data.replace(b"\r\n", b"\n"),
        lambda data: data.replace(b"\r\n", b"\r"),
        lambda data: data + b"\r\n\r\n",
        lambda data: b"\r\n".join(b'"' + line.replace(b",", b'","') + b'"' for line in data.splitlines()),
    ],
    ids=["byte order mark", "unix lines", "old lines", "empty lines at the end", "everything quoted"],
)
@pytest.mark.parametrize("name", ["races.csv", RESULTS])
def test_other_csv_dialects_give_the_same_season(folder, name, written):
    rewritten(folder / name, written)
    proof = proof_of(bring(folder)[0])
    assert (proof["races"], proof["results"]) == (3, 37) and proof["order"]["pairs"] == proof["order"]["agree"]


def test_reordered_and_unknown_columns_are_tolerated(folder):
    for name in ("races.csv", RESULTS):
        rows = read_csv(folder / name)
        mixed = [{"note": "two\nlines", **dict(reversed(row.items()))} for row in rows]
        write_csv(folder / name, list(mixed[0]), mixed)
    assert proof_of(bring(folder)[0])["results"] == 37


@pytest.mark.parametrize(
    "alias", ["Łukasz", "日本の車", "O'Neil, Jr.", "<b>bold</b>", "=1+1", "a" * 64, "../../etc", "é́"]
)
def test_an_invalid_alias_is_kept_only_in_the_record(folder, alias, client):
    change(folder, RESULTS, 2, Alias=alias)
    bring(folder)
    racer = Racer.objects.get(record_id="racer-00001")
    assert racer.alias.isascii() and Entry.objects.get(racer=racer, race__round__stage="open-qualifier").record.alias
    assert client.get(racer.get_absolute_url()).status_code == 200
    race = Race.objects.get(round__stage="open-qualifier")
    assert client.get(race.get_absolute_url()).status_code == 200


def test_a_symlink_inside_the_folder_is_read(folder):
    (folder / "elsewhere").mkdir()
    (folder / RESULTS).rename(folder / "elsewhere" / "open.csv")
    (folder / RESULTS).symlink_to(folder / "elsewhere" / "open.csv")
    assert proof_of(bring(folder)[0])["results"] == 37


@pytest.mark.parametrize("stem", ["new", "mine", "layout", "api"])
def test_a_race_never_takes_the_address_of_a_page(folder, stem):
    (folder / RESULTS).rename(folder / "results" / f"{stem}.csv")
    change(folder, "races.csv", 2, file=f"results/{stem}.csv")
    bring(folder)
    assert not Race.objects.filter(slug=stem).exists() and Race.objects.filter(slug__startswith=stem).exists()


# --- refused -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "time",
    [
        "0001-01-01T00:00:00+14:00",
        "0001-01-01T00:00:00+00:00",
        "9999-12-31T23:59:59-14:00",
        "9999-12-31T23:59:59+00:00",
        "1969-12-31T23:59:59+00:00",
    ],
)
@pytest.mark.parametrize("column", ["opens", "closes"])
def test_an_implausible_time_is_refused(folder, column, time):
    change(folder, "races.csv", 2, **{column: time})
    params = refused(folder, "import_value")
    assert (params["row"], params["column"], params["value"]) == (2, column, time)


@pytest.mark.parametrize(
    "value", ["-Infinity", "NaN", "1e999999999", "0e-99999999999", "9" * 5000, "1,000", " ", "٣", "+-3"]
)
@pytest.mark.parametrize("column", ["TotalLapTime", "RankingScore", "AvgResets"])
def test_an_invalid_number_is_refused_immediately(folder, column, value):
    if (column, value) == ("AvgResets", " ") or (column, value) == ("TotalLapTime", " "):
        value = "-"
    change(folder, RESULTS, 7, **{column: value})
    params = refused(folder, "import_value")
    assert (params["row"], params["column"]) == (7, column) and len(params["value"]) <= 60


@pytest.mark.parametrize("zero", ["0e999", "0.0e-999", "0000000000000000000000"])
def test_a_zero_with_many_digits_is_zero(folder, zero):
    change(folder, RESULTS, 7, AvgResets=zero, ResetCount=zero)
    bring(folder)
    assert Entry.objects.get(racer__alias="racer-00006", race__round__stage="open-qualifier").resets == 0


def loop(path: Path) -> None:
    path.symlink_to(path)


def into_etc(path: Path) -> None:
    path.symlink_to("/etc/passwd")


@pytest.mark.parametrize(
    "instead, code",
    [
        (loop, "import_path"),
        (into_etc, "import_path"),
        (lambda path: path.mkdir(), "import_no_folder"),
        (lambda path: os.mkfifo(path), "import_no_folder"),
        (lambda path: path.write_bytes(b""), "import_columns"),
        (lambda path: path.write_bytes(b"\0" * 100), "import_columns"),
        (lambda path: path.write_bytes("Alias,Rank\n".encode("utf-16")), "import_not_text"),
        (lambda path: path.write_bytes(b"\x1f\x8b\x08\x00rest of a gzip"), "import_not_text"),
    ],
    ids=["a link to itself", "a link outside", "a folder", "a pipe", "nothing", "zeros", "UTF-16", "packed"],
)
def test_a_path_that_is_not_a_file_of_the_folder_is_refused(folder, instead, code):
    (folder / RESULTS).unlink()
    instead(folder / RESULTS)
    refused(folder, code)
    (folder / "races.csv").unlink()
    instead(folder / "races.csv")
    refused(folder, {loop: "import_no_folder", into_etc: "import_columns"}.get(instead, code))


@pytest.mark.parametrize("file", ["results/../races.csv", "races.csv", "./races.csv", "results//../races.csv"])
def test_an_index_file_cannot_serve_as_results(folder, file):
    change(folder, "races.csv", 2, file=file)
    refused(folder, "import_file_twice")


@pytest.mark.parametrize("file", ["results\0.csv", "results/a\nb.csv", "a" * 201, "", "results/" + "a" * 190])
def test_an_invalid_file_name_is_refused(folder, file):
    if "\0" in file:
        rewritten(folder / "races.csv", lambda data: data.replace(RESULTS.encode(), file.encode()))
    else:
        change(folder, "races.csv", 2, file=file)
    refused(folder)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_truncated_file_is_refused(folder, share):
    for name in (RESULTS, FEW[1].file):
        whole = (folder / name).read_bytes()
        (folder / name).write_bytes(whole[: int(share * len(whole))])
        refused(folder)
        (folder / name).write_bytes(whole)
    bring(folder)


@pytest.mark.parametrize("name", [RESULTS, "races.csv"])
def test_a_duplicate_column_is_refused(folder, name):
    rewritten(folder / name, lambda data: b"\r\n".join(line + b"," + line.split(b",")[0] for line in data.splitlines()))
    assert "twice" in refused(folder, "import_not_text")["problem"]


def test_a_cell_of_a_megabyte_is_refused(folder):
    change(folder, RESULTS, 7, Alias="a" * 2**20)
    refused(folder)


def test_a_season_at_the_address_of_a_page_is_refused(folder):
    rows = read_csv(folder / "races.csv")
    for row in rows:
        row["season"] = "New"
    write_csv(folder / "races.csv", list(rows[0]), rows)
    assert refused(folder, "season_address_reserved") == {"season": "new"}


def test_importing_again_with_other_numbers_is_refused(folder):
    bring(folder, promotion_percent=20)
    before = everything()
    assert refused(folder, "import_numbers_differ", promotion_percent=30) == {
        "season": "2031",
        "number": "promotion_percent",
    }
    bring(folder, promotion_percent=20)
    bring(folder)
    assert everything() == before


# --- a record is driven ---------------------------------------------------------------------------------------------


def test_nobody_can_enter_an_imported_race(tmp_path, alice):
    track_row("oval")
    write_season(tmp_path, [month(0, "single", [(1, 9000)], track="Oval")])
    bring(tmp_path, now=START + timedelta(days=3))
    with pytest.raises(UserFault) as caught:
        enter_race(race=Race.objects.get(), racer=alice, now=START + timedelta(days=3))
    assert caught.value.code == "race_recorded"


def test_deleting_an_imported_racer_keeps_the_season(folder, client):
    bring(folder)
    Racer.objects.get(record_id="racer-00001").delete()
    race = Race.objects.get(round__stage="open-qualifier")
    assert board(race).rows[0].alias == "racer-00002"
    assert client.get("/seasons/2031/").status_code == 200 == client.get("/seasons/2031/standings/").status_code


@pytest.mark.django_db(transaction=True)
def test_concurrent_imports_of_a_folder_import_it_once(folder):
    found = at_once([lambda: import_folder(folder=folder, now=START)] * 3)
    assert [one.slug for each in found for one in each] == ["2031"] * 3
    assert Season.objects.count() == 1 and Round.objects.count() == 3 and Entry.objects.count() == 37


def test_a_season_cannot_take_the_address_of_a_page(db):
    for slug in ("new", "now"):
        with pytest.raises(Exception) as caught:
            create_season(slug=slug, name="x", starts_on=START.date(), ends_on=(START + timedelta(days=9)).date())
        assert "slug" in caught.value.error_dict


@pytest.mark.parametrize("score", [2**61, 2**61 + 2**60 + 30_000, 2**62 - 1, 2**60])
def test_a_duel_score_in_another_race_type_is_refused(folder, score):
    change(folder, RESULTS, 31, RankingScore=str(score))
    params = refused(folder, "import_value")
    assert (params["row"], params["column"]) == (31, "RankingScore")
