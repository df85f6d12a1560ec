"""What comes of a recorded season that is imported."""

from __future__ import annotations

from datetime import timedelta

import pytest

from accounts.models import Racer
from league.history.proof import proof_of
from league.models import ChampionshipPlace, FinalePlace, Membership, RoundPoints, Season
from paddock.errors import UserFault
from races.boards.selectors.board import board, rank_of
from races.entries.services.standings import recompute_race
from races.errors import RaceRefused
from races.models import Entry, Race
from races.ranks import NOT_CLASSIFIED
from tests.factories import a_racer
from tests.league import seasons
from tests.league.histories import START, month, read_csv, result_rows, write_csv, write_season
from tests.league.records import FEW, bring, everything, refused
from tests.rows import track_row

pytestmark = pytest.mark.django_db


def test_an_imported_season_is_replayed_by_our_rules(folder):
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


def test_an_imported_race_is_a_normal_race(folder, django_assert_max_num_queries):
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


def test_recomputing_an_imported_race_keeps_its_results(folder):
    bring(folder)
    before = everything()
    for race in Race.objects.all():
        recompute_race(race=race)
    assert everything() == before


def test_imported_racers_cannot_log_in(folder, client):
    bring(folder)
    racer = Racer.objects.get(alias="racer-00001")
    assert not racer.is_active and not racer.has_usable_password() and racer.record_id == "racer-00001"
    assert racer.email.endswith("@record.invalid") and not client.login(username="racer-00001", password="!")


def test_an_existing_racer_keeps_an_imported_alias(folder):
    mine = a_racer("Racer-00001")
    bring(folder)
    other = Racer.objects.get(record_id="racer-00001")
    assert other.pk != mine.pk and other.alias == "racer-00001-2"
    assert not mine.entries.exists()


def test_a_track_is_found_by_name_or_stored_as_a_name_only(tmp_path, client):
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


def test_a_season_cannot_be_imported_twice(folder):
    bring(folder)
    rows = read_csv(folder / FEW[0].file)
    rows[0]["SubmissionCount"] = "7"
    write_csv(folder / FEW[0].file, list(rows[0]), rows)
    assert refused(folder) == {"season": "2031"}, "import_season_differs"


def test_an_import_does_not_overwrite_a_local_season(folder):
    seasons.create_season(slug="2031", name="Ours", starts_on=START.date(), ends_on=START.date() + timedelta(days=9))
    refused(folder, "import_season_exists")


def test_season_numbers_can_be_passed_in(folder):
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
def test_invalid_season_numbers_import_nothing(folder, options, code):
    with pytest.raises(RaceRefused) as caught:
        bring(folder, **options)
    assert caught.value.code == code and not Season.objects.exists() and not Race.objects.exists()


def test_equal_scores_may_be_in_any_order(tmp_path):
    race = month(0, "open-qualifier", [(1, 30_000), (2, 30_000), (3, 31_000)])
    write_season(tmp_path, [race])
    rows = result_rows(race)
    rows[0], rows[1] = rows[1] | {"Rank": 1}, rows[0] | {"Rank": 2}
    rows[2]["RankingScore"] = 32_000
    write_csv(tmp_path / race.file, list(rows[0]), rows)
    (season,) = bring(tmp_path)
    proof = proof_of(season)
    assert proof["order"] == {"pairs": 2, "agree": 2} and proof["scores"] == {"checked": 3, "agree": 2}


@pytest.mark.parametrize("names", [("Monthly", "Monthly"), ("Qualifier {}", "Finale {}"), ("Race {}", "Race {}")])
def test_a_finale_belongs_to_the_preceding_pro_race(tmp_path, names):
    races = []
    for number in range(3):
        called, finale = (name.format(number) for name in names)
        cast = [(10 * number + n, 40_000 + 1000 * n) for n in range(1, 6)]
        races.append(month(number, "open-qualifier", cast, name=called))
        races.append(month(number, "pro-qualifier", cast, name=called))
        races.append(month(number, "pro-finale", [(racer, 9_000 + racer) for racer, _score in cast[:3]], name=finale))
    (season,) = bring(write_season(tmp_path, races))
    assert proof_of(season)["finale"] == {"places": 9, "agree": 9}
    numbers = {
        stage: list(season.rounds.filter(stage=stage).order_by("race__closes_at").values_list("number", flat=True))
        for stage in ("pro-qualifier", "pro-finale")
    }
    assert numbers["pro-qualifier"] == numbers["pro-finale"] == [1, 2, 3]
