"""A track's record: only laps of simulated, classified time trials of one direction by standard rules count."""

from __future__ import annotations

import pytest

from races.boards.track_figures import standard_races
from tests.factories import a_race, a_racer, drive, laps
from tracks.models import Track
from tracks.selectors import with_figures

pytestmark = pytest.mark.django_db


def records(track: Track) -> tuple[int | None, int | None]:
    found = with_figures(Track.objects.filter(pk=track.pk)).get()
    return found.record_ms, found.record_reverse_ms


@pytest.fixture
def race(now):
    made = a_race(now, slug="standard")
    drive(made, a_racer("alice"), laps(9000, 8000, 8500), now)
    return made


@pytest.mark.parametrize(
    "rules",
    [
        {"off_track_penalty_ms": 0},
        {"off_track_penalty_ms": 1999},
        {"race_type": "object_avoidance", "random_boxes": 1},
        {"race_type": "head_to_head", "opponents": "bots", "bots": 1},
    ],
)
def test_laps_by_other_rules_set_no_record(race, now, rules):
    other = a_race(now, slug="other", track=race.track, **rules)
    drive(other, a_racer("bob"), laps(600, 600, 600), now)
    assert records(race.track) == (8000, None)


def test_a_stricter_penalty_is_standard(race, now):
    other = a_race(now, slug="other", track=race.track, off_track_penalty_ms=5000)
    drive(other, a_racer("bob"), laps(7000, 7000, 7000), now)
    assert records(race.track) == (7000, None)


def test_each_direction_has_its_record(race, now):
    other = a_race(now, slug="other", track=race.track, direction="cw")
    drive(other, a_racer("bob"), laps(600, 600, 600), now)
    assert records(race.track) == (8000, 600)


def test_a_lap_of_a_car_that_is_not_classified_is_no_record(race, now):
    other = a_race(now, slug="other", track=race.track)
    drive(other, a_racer("bob"), laps(600), now)
    assert records(race.track) == (8000, None)


def test_a_typed_lap_of_a_real_car_is_no_record(race, now):
    type(race).objects.filter(pk=race.pk).update(physical=True, engine="")
    assert records(race.track) == (None, None)
    assert not standard_races().exists()
