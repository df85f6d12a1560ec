"""Recorded seasons: what is refused, what comes of an import, and the way back."""

from __future__ import annotations

import json
from collections import Counter
from datetime import timedelta
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from django.core.management import CommandError, call_command
from django.db import transaction
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from faults import UserFault
from league.history import read_folder
from league.models import (
    ChampionshipPlace,
    FinalePlace,
    Membership,
    Racer,
    RecordedResult,
    Round,
    RoundPoints,
    Season,
)
from league.rules import Promotion
from league.selectors.proof import proof_of
from league.services import close_due_rounds
from league.services.exporting import export_season
from league.services.importing import import_folder
from races.errors import RaceRefused
from races.models import Entry, Race
from races.ranking import NOT_CLASSIFIED
from races.selectors import board, rank_of
from races.services import recompute_race
from tests.factories import a_racer
from tests.league import seasons
from tests.league.histories import START, month, random_season, read_csv, result_rows, write_csv, write_season
from tests.rows import track_row
from tracks.models import Track

pytestmark = pytest.mark.django_db

FEW = [
    month(0, "open-qualifier", [(n, 30_000 + 1000 * n) for n in range(1, 31)]),
    month(1, "pro-qualifier", [(1, 40_000), (2, 41_000), (3, 42_000), (99, 43_000)]),
    month(1, "pro-finale", [(3, 9_000), (1, 9_500), (2, None)]),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_season(tmp_path / "record", FEW)


def bring(folder: Path, now=START, **options):
    return import_folder(folder=folder, now=now, **options)


def everything() -> dict[str, list]:
    models = (Season, Round, Race, Racer, Track, Entry, RecordedResult, Membership, FinalePlace)
    models += (ChampionshipPlace, RoundPoints)
    return {model.__name__: list(model.objects.order_by("pk").values()) for model in models}


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# --- what comes of an import ---------------------------------------------------------------------------------------


def test_an_imported_season_is_raced_through_by_our_own_rules(folder):
    (season,) = bring(folder)
    proof = proof_of(season)
    assert {name: proof[name] for name in ("races", "results", "racers")} == {"races": 3, "results": 37, "racers": 31}
    assert proof["order"] == {"pairs": 435 + 6 + 3, "agree": 435 + 6 + 3}
    assert proof["scores"] == {"checked": 36, "agree": 36}
    assert proof["promotion"] == {"checked": 4, "agree": 3}
    assert proof["finale"] == {"places": 3, "agree": 3}
    assert proof["championship"] == 2, "the third of the finale was not classified"
    assert proof["differences"]["promotion"] == [{"race": "2031-01-29-pro-qualifier-month2", "racer": "racer-00099"}]
    assert (season.slug, str(season.starts_on)) == ("2031", "2031-01-01")
    assert list(season.rounds.order_by("race__closes_at").values_list("number", flat=True)) == [1, 2, 2]
    assert not season.rounds.filter(closed_at=None).exists()


def test_an_imported_race_is_a_real_one(folder, django_assert_max_num_queries):
    bring(folder)
    race = Race.objects.get(round__stage="open-qualifier")
    assert race.imported_at == START and race.division == "open" and race.name == "Month 1 · open"
    page = board(race)
    assert [row.rank for row in page.rows] == list(range(1, 31)) and page.classified_count == 30
    assert page.rows[0].alias == "racer-00001" and page.rows[0].gap_ms == 0 and page.rows[3].gap_ms == 3000
    assert page.rows[0].has_fastest_lap
    entry = Entry.objects.get(race=race, racer__alias="racer-00007")
    assert rank_of(entry) == 7 and entry.best is None and entry.submission_count == 8
    finale = Race.objects.get(round__stage="pro-finale")
    last = board(finale).rows[-1]
    assert (last.rank, last.alias) == (None, "racer-00002") and last.entry.rank_score == NOT_CLASSIFIED - 2


def test_working_out_an_imported_race_anew_keeps_its_results(folder):
    bring(folder)
    before = everything()
    for race in Race.objects.all():
        recompute_race(race=race)
    assert everything() == before


def test_racers_of_a_record_cannot_log_in(folder, client):
    bring(folder)
    racer = Racer.objects.get(alias="racer-00001")
    assert not racer.is_active and not racer.has_usable_password() and racer.record_id == "racer-00001"
    assert racer.email.endswith("@record.invalid") and not client.login(username="racer-00001", password="!")


def test_a_racer_who_has_the_alias_already_keeps_it(folder):
    mine = a_racer("Racer-00001")
    bring(folder)
    other = Racer.objects.get(record_id="racer-00001")
    assert other.pk != mine.pk and other.alias == "racer-00001-2"
    assert not mine.entries.exists()


def test_a_track_is_found_by_its_name_or_kept_as_a_name_alone(tmp_path, client):
    oval = track_row("oval")
    write_season(tmp_path, [month(0, "single", [(1, 9000)], track="Oval"), month(1, "single", [(1, 9000)])])
    bring(tmp_path)
    first, second = Race.objects.order_by("opens_at")
    assert first.track == oval and first.division == "all"
    assert not second.track.has_shape and second.track.name == "some_track"
    with pytest.raises(UserFault) as caught:
        second.track.geometry  # noqa: B018
    assert caught.value.code == "track_shape_unknown"
    for address in (second.get_absolute_url(), second.track.get_absolute_url(), "/tracks/", "/races/"):
        assert client.get(address).status_code == 200, address
    page = client.get(second.get_absolute_url()).content.decode()
    assert "length unknown" in page and "racer-00001" in page
    assert client.get(f"/api/v1/tracks/{second.track.slug}/").json()["centre"] is None


def test_importing_twice_changes_nothing(folder):
    bring(folder)
    before = everything()
    (again,) = bring(folder, now=START + timedelta(days=400))
    assert everything() == before and again.slug == "2031"


def test_a_season_is_imported_once(folder):
    bring(folder)
    rows = read_csv(folder / FEW[0].file)
    rows[0]["SubmissionCount"] = "7"
    write_csv(folder / FEW[0].file, list(rows[0]), rows)
    assert refused(folder) == {"season": "2031"}, "import_season_differs"


def test_a_season_of_ones_own_is_not_overwritten(folder):
    seasons.create_season(slug="2031", name="Ours", starts_on=START.date(), ends_on=START.date() + timedelta(days=9))
    refused(folder, "import_season_exists")


def test_the_numbers_of_the_season_can_be_given(folder):
    (season,) = bring(folder, promotion_percent=50, finale_size=2, championship_places=1, points=[3, 1])
    assert Membership.objects.filter(season=season).count() == 15
    assert FinalePlace.objects.count() == 2 and ChampionshipPlace.objects.count() == 1
    assert RoundPoints.objects.filter(round__stage="open-qualifier").count() == 2


@pytest.mark.parametrize(
    "options, code",
    [
        ({"promotion_percent": 0}, "season_cut"),
        ({"promotion_percent": 100}, "season_cut"),
        ({"points": [1, 2]}, "season_points_rise"),
        ({"points": ["x"]}, "season_points_shape"),
    ],
)
def test_numbers_that_make_no_season_import_nothing(folder, options, code):
    with pytest.raises(RaceRefused) as caught:
        bring(folder, **options)
    assert caught.value.code == code and not Season.objects.exists() and not Race.objects.exists()


def test_equal_scores_may_have_any_order_and_a_score_that_is_no_time_is_told(tmp_path):
    race = month(0, "open-qualifier", [(1, 30_000), (2, 30_000), (3, 31_000)])
    write_season(tmp_path, [race])
    rows = result_rows(race)
    rows[0], rows[1] = rows[1] | {"Rank": 1}, rows[0] | {"Rank": 2}
    rows[2]["RankingScore"] = 32_000
    write_csv(tmp_path / race.file, list(rows[0]), rows)
    (season,) = bring(tmp_path)
    proof = proof_of(season)
    assert proof["order"] == {"pairs": 2, "agree": 2} and proof["scores"] == {"checked": 3, "agree": 2}


# --- what is refused -----------------------------------------------------------------------------------------------


def refused(folder: Path, code: str | None = None, **options) -> dict:
    before = everything()
    with pytest.raises(UserFault) as caught:
        bring(folder, **options)
    assert code in (None, caught.value.code)
    assert everything() == before, "nothing is half imported"
    assert "?" not in str(caught.value)
    return caught.value.params


def change(folder: Path, name: str, at: int, /, **cells: str) -> None:
    """Write other cells into row ``at`` (the heading is row 1) of a file."""
    rows = read_csv(folder / name)
    rows[at - 2].update(cells)
    write_csv(folder / name, list(rows[0]), rows)


RESULTS = FEW[0].file


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
def test_a_cell_that_cannot_be_is_refused_by_file_row_and_column(folder, column, value):
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
def test_a_race_that_cannot_be_is_refused_by_row_and_column(folder, column, value):
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


def test_a_racer_twice_is_refused_with_both_rows(folder):
    change(folder, RESULTS, 9, UserId="racer-00002")
    params = refused(folder, "import_duplicate_racer")
    assert (params["file"], params["row"], params["other"]) == (RESULTS, 9, 3)
    change(folder, RESULTS, 9, UserId="racer-00008", Alias="Racer-00002")
    assert refused(folder, "import_duplicate_racer")["row"] == 9


def test_a_rank_that_contradicts_the_score_is_refused(folder):
    change(folder, RESULTS, 5, Rank="5")
    change(folder, RESULTS, 6, Rank="4")
    params = refused(folder, "import_rank")
    assert (params["row"], params["rank"], params["score"]) == (5, 5, 34_000)
    change(folder, RESULTS, 5, Rank="4")
    change(folder, RESULTS, 6, Rank="4")
    assert refused(folder, "import_rank")["other_rank"] == 4


def test_a_file_that_is_not_whole_is_refused(folder):
    rows = read_csv(folder / RESULTS)
    write_csv(folder / RESULTS, list(rows[0]), rows[:-1])
    assert refused(folder, "import_row_count") == {"file": RESULTS, "found": 29, "said": 30}


def test_a_race_that_closes_before_it_opens_is_refused(folder):
    change(folder, "races.csv", 2, opens=FEW[0].closes.isoformat(), closes=FEW[0].opens.isoformat())
    assert refused(folder, "import_times") == {"row": 2}


def test_races_of_one_division_that_overlap_are_refused(tmp_path):
    long = month(0, "open-qualifier", [(1, 30_000)])
    long.closes += timedelta(hours=1)
    write_season(tmp_path, [long, month(1, "open-qualifier", [(1, 30_000)])])
    params = refused(tmp_path, "import_overlap")
    assert (params["row"], params["other"]) == (3, 2)


def test_single_races_may_overlap(tmp_path):
    write_season(
        tmp_path, [month(0, "single", [(1, 30_000)], name=f"Cup {n}", file=f"results/{n}.csv") for n in (1, 2)]
    )
    for number in (1, 2):
        write_csv(tmp_path / f"results/{number}.csv", list(result_rows(FEW[0])[0]), result_rows(FEW[0])[:1])
    assert len(bring(tmp_path)[0].rounds.all()) == 2


@pytest.mark.parametrize("file", ["../outside.csv", "/etc/passwd", "results/../../outside.csv"])
def test_no_file_outside_the_folder_is_read(folder, file):
    change(folder, "races.csv", 2, file=file)
    assert refused(folder, "import_path") == {"row": 2, "file": file}


def test_a_file_that_is_missing_twice_named_or_no_table_is_refused(folder):
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


def test_a_row_of_another_length_is_refused(folder):
    with (folder / RESULTS).open("a") as file:
        file.write("racer-1,2,3\r\n")
    assert refused(folder, "import_cells") == {"file": RESULTS, "row": 32, "found": 3, "columns": 16}


def test_a_season_that_is_not_there_is_refused_with_those_that_are(folder, tmp_path):
    assert refused(folder, "import_no_season", season="1999") == {"season": "1999", "seasons": "2031"}
    refused(tmp_path / "nothing", "import_no_folder")
    rows = read_csv(folder / "races.csv")
    write_csv(folder / "races.csv", list(rows[0]), [])
    refused(folder, "import_empty")


def test_one_bad_season_of_a_folder_imports_none(folder):
    rows = read_csv(folder / "races.csv")
    rows[2]["season"] = "2032"
    write_csv(folder / "races.csv", list(rows[0]), rows)
    seasons.create_season(slug="2032", name="x", starts_on=START.date(), ends_on=START.date() + timedelta(days=9))
    refused(folder, "import_season_exists")
    assert [one.slug for one in bring(folder, season="2031")] == ["2031"]


# --- the commands --------------------------------------------------------------------------------------------------


def run(*arguments: object, **options) -> str:
    out = StringIO()
    call_command(*map(str, arguments), stdout=out, stderr=StringIO(), **options)
    return out.getvalue()


def test_the_command_prints_the_agreement_and_the_same_again(folder):
    first = run("import_season", folder, "--season", "2031", "--json")
    data = json.loads(first)
    assert data["order"]["pairs"] == data["order"]["agree"] and data["championship"] == 2
    assert run("import_season", folder, "--season", "2031", "--json") == first
    assert "promotion: 3 of 4 agree" in run("import_season", folder)


def test_several_seasons_are_summed(folder):
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
        (("--points", "1,2"), "season_points_rise"),
        (("--points", "one"), "season_points_shape"),
        (("--season", "1999"), "import_no_season"),
    ],
)
def test_the_command_refuses_with_a_code(folder, arguments, code):
    with pytest.raises(CommandError, match=f"^{code}: "):
        run("import_season", folder, *arguments)
    assert not Season.objects.exists()


def test_export_needs_a_season_and_an_empty_folder(folder, tmp_path):
    with pytest.raises(CommandError, match=r"There is no season x\. There is: none"):
        run("export_season", "x", tmp_path / "new")
    run("import_season", folder)
    assert "3 races" in run("export_season", "2031", tmp_path / "new")
    with pytest.raises(CommandError, match=r"^export_folder_used: "):
        run("export_season", "2031", tmp_path / "new")


# --- the way back --------------------------------------------------------------------------------------------------


def test_an_export_is_what_was_imported_to_the_byte(folder, tmp_path):
    (season,) = bring(folder)
    export_season(season=season, folder=tmp_path / "out")
    assert contents(tmp_path / "out") == contents(folder)


def test_who_was_disqualified_is_no_longer_in_the_record(folder, tmp_path):
    (season,) = bring(folder)
    Entry.objects.filter(racer__alias="racer-00002").update(withdrawn_at=START, removed_at=START)
    export_season(season=season, folder=tmp_path / "out")
    rows = read_csv(tmp_path / "out" / RESULTS)
    assert [(row["Alias"], row["Rank"]) for row in rows[:2]] == [("racer-00001", "1"), ("racer-00003", "2")]
    assert read_csv(tmp_path / "out" / "races.csv")[0]["racers"] == "29" == str(len(rows))
    read_folder(tmp_path / "out")


def test_a_season_that_was_raced_here_goes_out_and_comes_back(tmp_path, bell):
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


# --- any season ----------------------------------------------------------------------------------------------------


@settings(
    max_examples=25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(seed=st.integers(0, 2**32), percent=st.integers(1, 99), size=st.integers(1, 12), places=st.integers(1, 12))
def test_any_season_keeps_the_rules(db, seed, percent, size, places):
    numbers = {"promotion_percent": percent, "finale_size": size, "championship_places": min(places, size)}
    races = random_season(seed)
    with TemporaryDirectory() as name, transaction.atomic():
        folder = write_season(Path(name) / "in", races)
        (season,) = bring(folder, **numbers)
        before = everything()
        _check_rules(season)
        proof = proof_of(season)
        assert proof["order"]["pairs"] == proof["order"]["agree"]
        assert proof["results"] == sum(len(race.scores) for race in races)
        bring(folder, **numbers)
        assert everything() == before, "importing twice changes nothing"
        export_season(season=season, folder=Path(name) / "out")
        assert contents(Path(name) / "out") == contents(folder)
        outcome = _outcome(season)
        transaction.set_rollback(True)
    # the same results in any other order of rows are the same season
    with TemporaryDirectory() as name, transaction.atomic():
        folder = write_season(Path(name), races)
        for race in races:
            rows = read_csv(folder / race.file)
            if rows:
                write_csv(folder / race.file, list(rows[0]), rows[::-1])
        (season,) = bring(folder, **numbers)
        assert _outcome(season) == outcome
        transaction.set_rollback(True)


def _check_rules(season: Season) -> None:
    promoted = list(Membership.objects.filter(season=season).values_list("racer", flat=True))
    assert len(promoted) == len(set(promoted)), "promoted at most once, and nobody in two divisions"
    for round_ in season.rounds.all():
        classified = Entry.objects.filter(race=round_.race, classified=True).count()
        if round_.stage == "open-qualifier":
            most = Promotion(season.promotion_percent).places(classified)
            earlier = Membership.objects.filter(season=season, since__lt=round_.race.closes_at).values("racer")
            best = [row.entry.racer_id for row in board(round_.race, per_page=1000).rows][:most]
            new = set(best) - set(Membership.objects.filter(racer__in=earlier).values_list("racer", flat=True))
            assert set(round_.promotions.values_list("racer", flat=True)) == new
        elif round_.stage == "pro-qualifier":
            field = list(round_.finale_places.values_list("racer", flat=True))
            qualified = set(
                ChampionshipPlace.objects.filter(
                    season=season, round__race__closes_at__lte=round_.race.closes_at
                ).values_list("racer", flat=True)
            )
            free = Entry.objects.filter(race=round_.race, classified=True).exclude(racer__in=qualified).count()
            assert len(field) == min(season.finale_size, free) and not qualified & set(field)
        elif round_.stage == "pro-finale":
            assert round_.championship_places.count() <= min(season.championship_places, classified)
    finalists = Counter(ChampionshipPlace.objects.filter(season=season).values_list("racer", flat=True))
    assert not finalists or max(finalists.values()) == 1


def _outcome(season: Season) -> dict[str, list]:
    return {
        "pros": sorted(Membership.objects.filter(season=season).values_list("racer__record_id", "place", "since")),
        "fields": sorted(FinalePlace.objects.values_list("round__number", "place", "racer__record_id")),
        "qualified": sorted(ChampionshipPlace.objects.values_list("round__number", "place", "racer__record_id")),
        "points": sorted(RoundPoints.objects.values_list("round__number", "round__stage", "rank", "racer__record_id")),
    }
