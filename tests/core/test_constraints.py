"""A race's check constraints are asked about in one query, and say what Django's own way says."""

from __future__ import annotations

from functools import partial

import pytest
from django.core.exceptions import ValidationError
from django.db import connection, models
from django.test.utils import CaptureQueriesContext

from races.models import Race
from tests.factories import a_race

# A value that breaks a constraint, by the column that it is in
BROKEN = {
    "max_submissions": 0,
    "max_simulated_ms": 1,
    "laps": 0,
    "off_track_penalty_ms": -1,
    "division": "pro",
    "next_engine": "paddock-v9",
}


@pytest.fixture
def race(db, now) -> Race:
    return a_race(now)


def test_all_checks_of_a_sound_race_are_one_query(race):
    with CaptureQueriesContext(connection) as asked:
        race.validate_constraints()
    assert len(Race._meta.constraints) > 10
    assert len(asked) <= 3  # the query and its savepoint


@pytest.mark.parametrize(("column", "value"), BROKEN.items())
@pytest.mark.parametrize("exclude", [set(), {"kind"}, {"laps", "closes_at"}], ids=["all fields", "no kind", "no laps"])
def test_a_broken_check_is_reported_as_django_reports_it(race, column, value, exclude):
    setattr(race, column, value)
    assert said(race.validate_constraints, exclude) == said(partial(models.Model.validate_constraints, race), exclude)


@pytest.mark.parametrize(("column", "value"), BROKEN.items())
def test_a_broken_check_is_noticed(race, column, value):
    setattr(race, column, value)
    assert said(race.validate_constraints, set())


def said(validate, exclude: set[str]) -> object:
    try:
        validate(exclude=exclude)
    except ValidationError as error:
        return error.message_dict
    return None
