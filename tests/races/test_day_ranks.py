"""Places gained since the start of the day."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client

from races.boards.day_ranks import note_ranks
from races.boards.selectors.board import board
from races.models import Entry, Race
from tests.factories import a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db


@pytest.fixture
def race(wakes, now) -> Race:
    race = a_race(now)
    for alias, time in (("bob", 10_000), ("alice", 11_000), ("carl", 11_250), ("steady", 10_500)):
        drive(race, a_racer(alias), laps(time, time, time), now)
    Entry.objects.filter(racer__alias="steady").update(is_baseline=True)
    return race


def gained(race: Race) -> dict[str, int | None]:
    race.refresh_from_db()
    return {row.alias: row.gained for row in board(race).rows}


def test_places_are_gained_and_lost_since_the_ranks_of_the_day(race, now):
    assert set(gained(race).values()) == {None}, "nothing was written down yet"
    assert note_ranks(now=now) == 1
    assert gained(race) == {"bob": 0, "steady": None, "alice": 0, "carl": 0}
    later = now + timedelta(minutes=5)
    drive(race, Entry.objects.get(racer__alias="carl").racer, laps(9_000, 9_000, 9_000), later)
    drive(race, a_racer("dora"), laps(10_600, 10_600, 10_600), later)
    assert gained(race) == {"carl": 2, "bob": -1, "steady": None, "dora": None, "alice": -2}
    html = " ".join(Client().get(race.get_absolute_url()).content.decode().split())
    assert "▲2" in html and "▼1" in html and "▼2" in html


def test_ranks_are_written_once_a_day(race, now):
    assert (note_ranks(now=now), note_ranks(now=now)) == (1, 0)
    drive(race, Entry.objects.get(racer__alias="carl").racer, laps(9_000, 9_000, 9_000), now)
    assert gained(race)["carl"] == 2
    assert note_ranks(now=now + timedelta(days=1)) == 1
    assert gained(race)["carl"] == 0


def test_a_race_that_is_over_shows_no_changes_after_a_day(race, now):
    note_ranks(now=now)
    Race.objects.filter(pk=race.pk).update(closes_at=now + timedelta(hours=1))
    note_ranks(now=now + timedelta(hours=2))
    assert gained(race)["bob"] == 0
    assert note_ranks(now=now + timedelta(hours=26)) == 0
    assert gained(race)["bob"] is None
