"""Purple is of who is classified, wherever it is shown."""

from __future__ import annotations

import pytest

from races.boards.selectors.board import board
from races.entries.services.standings import recompute_race
from races.models import Entry, Race
from races.replays.run_maps import lap_rows
from races.runs.video_titles import race_of_marks
from tests.factories import a_race, a_racer, drive, lap, laps

pytestmark = pytest.mark.django_db

FAST_BUT_LOST = [lap(1, 5_000, resets=40), lap(2, 9_000, complete=False, percentage=30)]
CLEAN = laps(9_000, 9_100, 9_200)
OWN = ("own_lap_ms", "own_sector_1_ms", "own_sector_2_ms", "own_sector_3_ms")


def fresh(race: Race) -> Race:
    return Race.objects.get(pk=race.pk)


def marks(race: Race) -> dict[str, tuple]:
    return {row.alias: (row.has_fastest_lap, set(row.sector_colours)) for row in board(fresh(race)).rows}


def test_an_unclassified_car_gets_no_fastest_lap_or_purple_sector(now):
    race = a_race(now)
    drive(race, a_racer("clean"), CLEAN, now)
    lost = drive(race, a_racer("lost"), FAST_BUT_LOST, now)
    assert marks(race) == {"clean": (True, {"purple"}), "lost": (False, {"green"})}
    assert fresh(race).fastest_lap_ms == 9_000
    rows = lap_rows(lost.evaluation.result.laps, race_of_marks(lost.evaluation))
    assert {colour for row in rows for _, colour in row.sectors} == {"green"}


def test_without_classified_cars_there_is_no_fastest_lap(now):
    race = a_race(now)
    drive(race, a_racer("lost"), FAST_BUT_LOST, now)
    assert (fresh(race).fastest_lap_ms, marks(race)) == (None, {"lost": (False, {"green"})})


@pytest.mark.parametrize("order", [(FAST_BUT_LOST, CLEAN), (CLEAN, FAST_BUT_LOST)])
def test_an_unclassified_run_gains_no_marks_from_a_classified_one(now, order):
    race, racer = a_race(now), a_racer("both")
    lost = [drive(race, racer, driven, now) for driven in order][order.index(FAST_BUT_LOST)]
    assert fresh(race).fastest_lap_ms == 9_000
    assert marks(race) == {"both": (True, {"purple"})}
    assert race_of_marks(lost.evaluation) is None
    before = Entry.objects.values(*OWN).get(race=race)
    recompute_race(race=race)
    assert (Entry.objects.values(*OWN).get(race=race), fresh(race).fastest_lap_ms) == (before, 9_000)


def test_a_faster_house_car_gets_no_purple_on_its_run_page(now):
    race = a_race(now)
    drive(race, a_racer("clean"), CLEAN, now)
    house = drive(race, a_racer("house", is_house=True), laps(8_000, 8_000, 8_000), now)
    assert race_of_marks(house.evaluation) is None
    assert board(fresh(race)).rows[0].has_fastest_lap is False
