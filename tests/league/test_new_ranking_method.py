"""A new ranking method is one class: lists, forms, the API, commands, boards and season files have it at once."""

from __future__ import annotations

import argparse
import csv
from datetime import timedelta

import pytest
from django.db import transaction
from django.test import Client
from django.utils import timezone
from drf_spectacular.generators import SchemaGenerator
from rest_framework.test import APIClient

from league.history.season_export import export_season
from league.models import Round, StageRules
from league.stewarding.official_results import close_due_rounds
from paddock.errors import UserFault
from paddock.rules.ranked import contradiction, usually_needed
from races.boards import ranking
from races.boards.selectors.board import board
from races.management.race_options import add_ranking_options, ranking_of
from races.models import OwnEvaluation, Race
from races.test_runs.services import drive_own
from tests.docs import ranking_table, rule_table
from tests.docs.pages import code_blocks, section, text
from tests.factories import a_model, a_race, a_racer, a_track, drive, laps
from tests.league import seasons
from tests.league.records import bring
from tests.pages.test_races import form

pytestmark = pytest.mark.django_db
CODE = "spread"


# The class that the page of common changes shows
(SPREAD,) = code_blocks(section(text("changes.md"), "## A ranking method"), "python")


@pytest.fixture(autouse=True)
def method(monkeypatch, wakes):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())
    exec(compile(SPREAD, "changes.md", "exec"), {})
    yield ranking.RULES[CODE]
    del ranking.RULES[CODE]


def test_a_class_without_a_name_of_its_own_is_refused(method):
    kind = type(method)
    with pytest.raises(ValueError, match="average"):
        ranking.register(type("Again", (kind,), {"code": "average"}))
    with pytest.raises(ValueError, match="7 letters"):
        ranking.register(type("Long", (kind,), {"code": "consistency"}))
    with pytest.raises(ValueError, match="lap_time_spread"):
        ranking.register(type("Same", (kind,), {"code": "same"}))
    assert list(ranking.RULES) == ["average", "best", "total", CODE]


def a_client(racer):
    client = Client()
    client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    return client


def test_a_race_is_made_with_it_in_the_form():
    a_track()
    client = a_client(a_racer("alice"))
    assert f'<option value="{CODE}">even laps</option>' in client.get("/races/new/").content.decode()
    answer = client.post("/races/new/", form(timezone.now(), ranking_method=CODE))
    race = Race.objects.get()
    assert answer["Location"] == race.get_absolute_url()
    assert (race.ranking_method, race.get_ranking_method_display()) == (CODE, "even laps")


def test_forms_of_seasons_and_test_runs_offer_it(now):
    admin = a_racer("admin", is_staff=True, is_superuser=True)
    a_model(admin)
    for address in ("/seasons/new/", "/runs/new/"):
        answer = a_client(admin).get(address)
        assert answer.status_code == 200, address
        assert f'<option value="{CODE}">even laps</option>' in answer.content.decode(), address


def test_the_schema_names_it_wherever_a_method_stands():
    schema = SchemaGenerator().get_schema(request=None, public=True)
    enums = {name for name, one in schema["components"]["schemas"].items() if "average" in one.get("enum", ())}
    assert enums
    for name in enums:
        assert CODE in schema["components"]["schemas"][name]["enum"], name


def test_the_api_makes_a_race_with_it_and_shows_its_board():
    now, alice = timezone.now(), a_racer("alice")
    client = APIClient()
    client.force_authenticate(alice)
    said = {"name": "Even", "track": a_track().slug, "opens_at": now, "closes_at": now + timedelta(days=3)}
    answer = client.post("/api/v1/races/", said | {"ranking_method": CODE}, format="json")
    assert answer.status_code == 201, answer.data
    race = Race.objects.get()
    assert (answer.data["ranking_method"], answer.data["ranking_rule"]) == (CODE, "Ranked by the spread of the laps.")
    shown = client.get(f"/api/v1/races/{race.slug}/board/").data
    assert shown["ranking_method"] == CODE


def test_its_score_orders_a_board_of_driven_cars(now):
    race = a_race(now, ranking_method=CODE)
    race.full_clean()
    drive(race, a_racer("quick"), laps(10_000, 10_900, 10_500), race.opens_at)
    drive(race, a_racer("even"), laps(14_000, 14_100, 14_050), race.opens_at)
    assert [(row.alias, row.entry.score_ms) for row in board(race).rows] == [("even", 100), ("quick", 900)]
    html = a_client(a_racer()).get(race.get_absolute_url()).content.decode()
    assert 'aria-sort="ascending">Spread</th>' in html and "0:00.100" in html
    assert "even laps" in a_client(a_racer()).get(f"{race.get_absolute_url()}rules/").content.decode()


def test_a_test_run_is_ranked_by_it(now):
    alice = a_racer("alice")
    drive_own(owner=alice, model=a_model(alice), track=a_track(), now=now, ranking_method=CODE)
    assert OwnEvaluation.objects.get().ranking_method == CODE


def test_commands_offer_it():
    parser = argparse.ArgumentParser()
    add_ranking_options(parser)
    options = vars(parser.parse_args(["--ranking-method", CODE]))
    assert ranking_of(options | {"laps": 5}) == (CODE, 3)


def test_the_tables_of_the_docs_have_it():
    assert f"`average`, `best`, `total`, `{CODE}`" in rule_table.replaced(text("reference.md"))
    row = "| even laps | the difference between the slowest and the fastest complete lap | N laps in a row |"
    for page in ranking_table.PAGES:
        assert row in ranking_table.replaced(page.read_text())


def test_rules_ask_a_method_whether_it_needs_all_laps(monkeypatch, method):
    assert (usually_needed(CODE, 5), contradiction(CODE, 5, 3)) == (3, "")
    monkeypatch.setattr(type(method), "needs_all_laps", True)
    assert (usually_needed(CODE, 5), contradiction(CODE, 5, 3)) == (5, "race_total_needs_all_laps")


def test_a_season_ranked_by_it_survives_export_and_import(tmp_path):
    season = seasons.a_season()
    StageRules.objects.update(ranking_method=CODE)
    january = seasons.a_round(season, 1, "open-qualifier", ranking_method=CODE)
    for number, spread in enumerate((300, 100, 200)):
        racer = a_racer(f"racer-{number}")
        drive(january.race, racer, laps(20_000, 20_000 + spread, 20_000), january.race.opens_at)
    order = [(row.alias, row.entry.score_ms) for row in board(january.race).rows]
    assert order == [("racer-1", 100), ("racer-2", 200), ("racer-0", 300)]
    close_due_rounds(now=seasons.after(january))
    assert export_season(season=season, folder=tmp_path / "out") == []
    with (tmp_path / "out" / "races.csv").open() as file:
        assert [row["timing_method"] for row in csv.DictReader(file)] == ["lap_time_spread"]
    Round.objects.all().delete()
    Race.objects.all().delete()
    season.delete()
    (back,) = bring(tmp_path / "out")
    race = Race.objects.get(round__season=back)
    assert race.ranking_method == CODE
    assert [(row.entry.record.alias, row.entry.score_ms) for row in board(race).rows] == order
    assert export_season(season=back, folder=tmp_path / "again") == []
    for file in (tmp_path / "out").rglob("*.csv"):
        assert (tmp_path / "again" / file.relative_to(tmp_path / "out")).read_text() == file.read_text()


def test_a_season_file_with_an_unknown_method_is_refused_with_the_known_ones(tmp_path, now):
    season = seasons.a_season()
    seasons.a_round(season, 1, "open-qualifier", ranking_method=CODE)
    close_due_rounds(now=seasons.after(Round.objects.get()))
    export_season(season=season, folder=tmp_path / "out")
    index = tmp_path / "out" / "races.csv"
    index.write_text(index.read_text().replace("lap_time_spread", "luck"))
    with pytest.raises(UserFault, match="avg_lap_time, best_lap_time, total_time, lap_time_spread"):
        bring(tmp_path / "out")


def test_a_running_car_is_not_ranked_by_another_method(now):
    """Screens of live events compute the score of laps only where its figure is known to them."""
    assert [rule.figure for rule in ranking.RULES.values()] == ["average_ms", "best_lap_ms", "total_ms", "score_ms"]
    assert not a_race(now, ranking_method=CODE).counts_all_laps
