"""``manage.py evaluate --race``: a car is timed by the rules of a race of this site, on its track."""

from __future__ import annotations

import json
from io import StringIO

import pytest
from django.core.management import CommandError, call_command

from core.management.base import OUR_FAULT, REFUSED, Refusal
from paddock.rules.race import BoxPlace
from races.management import race_options as races
from races.management.commands import evaluate as command
from tests.evaluation.stubs import outcome_of
from tests.factories import a_race
from tests.tracks.test_tracks_named import CAR_FILES, driven, imported  # noqa: F401  a fixture

pytestmark = pytest.mark.django_db


@pytest.fixture
def race(now, imported):  # noqa: F811
    return a_race(
        now,
        slug="boxes",
        track=imported,
        race_type="object_avoidance",
        boxes=[{"fraction": 0.5, "lane": "outer"}],
        laps=4,
        minimum_laps=2,
        ranking_method="best",
        direction="cw",
        off_track_penalty_ms=7_000,
        seed=9,
    )


@pytest.mark.parametrize("name", ["boxes", "/races/boxes/", "https://race.example/races/boxes/rules/?page=2"])
def test_the_run_is_told_what_a_run_of_the_race_is_told(name, race, monkeypatch):
    job = driven(monkeypatch, "--race", name)
    assert (job.rules.laps, job.rules.seed, job.rules.off_track_penalty_ms) == (4, 9, 7_000)
    assert job.rules.boxes == (BoxPlace(0.5, "outer"),)
    assert (job.track.direction, job.look) == ("cw", "bold")
    assert job.track == race.track.geometry.in_direction("cw")


def test_laps_are_worth_what_they_are_worth_in_the_race(race, monkeypatch):
    monkeypatch.setattr(command, "evaluate", lambda job, **kwargs: outcome_of())
    out = StringIO()
    call_command("evaluate", *CAR_FILES, "--race", "boxes", stdout=out)
    assert "by best, 2 laps in a row" in out.getvalue() or "by best, 1 laps in a row" in out.getvalue()


@pytest.mark.parametrize(
    "option",
    [("--laps", "3"), ("--look", "bold"), ("--box", "0.2:inner"), ("--minimum-laps", "1"), ("--lane-changes",)],
)
def test_a_race_has_rules_of_its_own(option, race):
    out = StringIO()
    with pytest.raises(Refusal, match="belong to --track") as refusal:
        call_command("evaluate", *CAR_FILES, "--race", "boxes", *option, "--json", stdout=out)
    assert (json.loads(out.getvalue())["error"]["code"], refusal.value.returncode) == ("command_line", REFUSED)


@pytest.mark.parametrize("name", ["boxers", "", "/races/", "a\0b"])
def test_a_race_that_is_not_there_is_refused_with_the_nearest(name, race):
    out = StringIO()
    with pytest.raises(Refusal) as refusal:
        call_command("evaluate", *CAR_FILES, f"--race={name}", "--json", stdout=out)
    error = json.loads(out.getvalue())["error"]
    assert (error["code"], refusal.value.returncode) == ("race_not_found", REFUSED)
    assert error["params"]["nearest"] == "boxes"


def test_without_a_database_it_is_our_fault_and_none_is_made(monkeypatch):
    monkeypatch.setattr(races, "has_database", lambda: False)
    with pytest.raises(Refusal) as refusal:
        call_command("evaluate", *CAR_FILES, "--race", "boxes", stdout=StringIO())
    assert (refusal.value.fault.code, refusal.value.returncode) == ("database_not_ready", OUR_FAULT)


@pytest.mark.parametrize("where", [(), ("--track", "oval", "--race", "boxes")])
def test_either_a_track_or_a_race_is_named(where):
    with pytest.raises(CommandError, match="--track"):
        call_command("evaluate", *CAR_FILES, *where)
