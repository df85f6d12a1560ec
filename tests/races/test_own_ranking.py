"""A ranking method that nobody has thought of here: one class, and every page names it and shows its score."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from django.db import transaction
from django.test import Client

from races.boards import ranking
from races.boards.ranking import Lap, RankingRule, Standing
from races.boards.selectors.board import board
from races.models import Race, RankingMethod
from races.rules.descriptions import score_name, worth_words
from tests.factories import a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db


class Slowest(RankingRule):
    """The slowest complete lap. It replaces a method that races may have."""

    code = "best"
    label = "slowest lap"
    column = "Slowest lap"

    def score(self, standing: Standing, laps: Sequence[Lap]) -> int | None:
        return max(lap["time_ms"] for lap in laps if lap["complete"])

    def rule(self, race: Race) -> str:
        return "Ranked by the slowest lap."


@pytest.fixture(autouse=True)
def _commits(monkeypatch):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


@pytest.fixture
def race(monkeypatch, now):
    monkeypatch.setitem(ranking.RULES, "best", Slowest())
    return a_race(now, ranking_method=RankingMethod.BEST)


def test_its_score_ranks_a_board(race, now):
    drive(race, a_racer("alice"), laps(10_000, 12_600, 12_900), now)
    drive(race, a_racer("bob"), laps(11_500, 12_300, 12_500), now)
    assert [(row.alias, row.entry.score_ms) for row in board(race).rows] == [("bob", 12_500), ("alice", 12_900)]


def test_its_name_stands_beside_what_a_run_came_to(race, now):
    submission = drive(race, a_racer("alice"), laps(10_000, 12_600, 12_900), now)
    assert score_name(race) == "Slowest lap"
    assert worth_words(submission.evaluation) == ("0:12.900", "Slowest lap")


def test_pages_have_a_column_for_its_score(race, now):
    racer = a_racer("alice")
    drive(race, racer, laps(10_000, 12_600, 12_900), now)
    client = Client()
    client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    html = client.get(race.get_absolute_url()).content.decode()
    assert '<th scope="col" class="num" aria-sort="ascending">Slowest lap</th>' in html
    assert html.count("aria-sort") == 1
    assert '<td class="num time">0:12.900</td>' in html
    assert '<td class="num c-mid best strong" data-label="Best lap">0:10.000' in html
    assert "Ranked by the slowest lap." in html
    html = client.get(f"{race.get_absolute_url()}runs/").content.decode()
    assert '<th scope="col" class="num">Slowest lap</th>' in html
    assert '<td class="num time" data-label="Slowest lap">0:12.900</td>' in html


def test_it_ranks_the_qualifying_of_duels_too(race):
    rule = ranking.Points(ranking.RULES["best"])
    standing = rule.standing(laps(10_000, 12_600, 12_900), 3)
    assert standing.score_ms == 12_900 and rule.name(race) == "Slowest lap"
    assert [column.label for column in rule.columns(race) if column.ranks] == ["Slowest lap"]
