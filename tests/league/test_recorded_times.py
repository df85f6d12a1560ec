"""Recorded seasons whose times contradict each other, and seasons that began with promoted racers."""

from __future__ import annotations

from datetime import timedelta
from io import StringIO

import pytest
from django.core.management import call_command

from league.history.proof import proof_of
from league.models import ChampionshipPlace, FinalePlace
from tests.league.histories import Recorded, month, write_season
from tests.league.records import bring

pytestmark = pytest.mark.django_db

PRO = [(number, 60_000 + number) for number in range(1, 7)]
FINALE = [(number, 9_000 + number) for number in range(1, 5)]


def early(finale: Recorded, pro: Recorded, *, days: int = 8, name: str | None = None) -> Recorded:
    """The finale with times that end before its pro race."""
    opens = pro.closes - timedelta(days=days)
    return Recorded(finale.stage, name or finale.name, opens, opens + timedelta(hours=5), finale.scores, finale.fields)


@pytest.mark.parametrize("name", [None, "The finale"])
def test_the_winners_of_a_finale_are_in_its_field_whatever_its_recorded_times(tmp_path, name):
    races = []
    for number in range(3):
        pro = month(number, "pro-qualifier", PRO)
        races += [pro, early(month(number, "pro-finale", FINALE), pro, name=name and f"{name} {number}")]
    (season,) = bring(write_season(tmp_path, races), finale_size=4, championship_places=1)
    proof = proof_of(season)
    first = season.rounds.get(number=1, stage="pro-qualifier")
    assert list(FinalePlace.objects.filter(round=first).order_by("pk").values_list("racer__alias", flat=True)) == [
        f"racer-{number:05}" for number in (1, 2, 3, 4)
    ]
    assert proof["championship"] == ChampionshipPlace.objects.count() == 3
    assert len([note for note in proof["notes"] if "before its pro race" in note]) == 3


def test_a_finale_that_closes_before_its_submissions_is_named(tmp_path):
    finale = month(0, "pro-finale", FINALE)
    finale.closes = finale.opens + timedelta(seconds=4)  # racers 1 to 4 submitted after 1 to 4 seconds and a few ms
    folder = write_season(tmp_path, [month(0, "pro-qualifier", PRO), finale])
    out = StringIO()
    call_command("import_season", folder, stdout=out)
    notes = [line for line in out.getvalue().splitlines() if line.startswith("note: ")]
    assert any("before the submission of" in note for note in notes)


def test_a_season_that_began_with_promoted_racers_says_so(tmp_path):
    races = [month(0, "open-qualifier", PRO), month(0, "pro-qualifier", PRO), month(1, "pro-qualifier", PRO[:1])]
    (season,) = bring(write_season(tmp_path, races))
    (note,) = proof_of(season)["notes"]
    assert "began with promoted racers" in note and "6 raced" in note


def test_a_season_whose_times_agree_has_no_notes(tmp_path):
    races = [month(0, "open-qualifier", PRO), month(1, "pro-qualifier", PRO[:1]), month(1, "pro-finale", PRO[:1])]
    (season,) = bring(write_season(tmp_path, races))
    assert proof_of(season)["notes"] == []
