"""What a board says about the car ahead: intervals, the line above, the house car to beat, a racer's own tries."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client

from accounts.models import Racer
from races.boards.selectors.board import board
from races.boards.selectors.shared_boards import shared_board
from races.models import Entry, Race
from races.runs.latest_run import latest_run
from tests.factories import a_race, a_racer, drive, laps

pytestmark = pytest.mark.django_db


@pytest.fixture
def race(wakes, now) -> Race:
    """Bob leads, a house car is next, then alice and carl."""
    race = a_race(now)
    for alias, time in (("bob", 10_000), ("steady", 10_400), ("alice", 11_000), ("carl", 11_250)):
        drive(race, a_racer(alias), laps(time, time, time), now)
    Entry.objects.filter(racer__alias="steady").update(is_baseline=True)
    return race


def page(racer: Racer, race: Race) -> str:
    client = Client()
    client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    return client.get(race.get_absolute_url()).content.decode()


def test_an_interval_is_to_the_ranked_racer_ahead(race):
    rows = board(race).rows
    assert [(row.alias, row.interval_ms, row.gap_ms) for row in rows] == [
        ("bob", None, 0),
        ("steady", 400, 400),
        ("alice", 1_000, 1_000),
        ("carl", 250, 1_250),
    ]
    assert [row.above and row.above.racer.alias for row in rows] == [None, "bob", "steady", "alice"]


def test_the_first_line_of_a_further_page_knows_the_line_above_it(race):
    (row,) = board(race, page=4, per_page=1).rows
    assert (row.alias, row.above.racer.alias, row.interval_ms) == ("carl", "alice", 250)


def test_a_racer_on_another_page_sees_how_much_gains_a_place(race):
    carl = Racer.objects.get(alias="carl")
    for per_page in (1, 4):
        assert shared_board(race, carl, per_page=per_page).my_row.interval_ms == 250
    leader = shared_board(race, Racer.objects.get(alias="bob"), page=2, per_page=1).my_row
    assert (leader.rank, leader.interval_ms) == (1, None)


def test_the_next_house_car_is_the_nearest_one_ahead(race, now):
    slow = drive(race, a_racer("slow"), laps(12_000, 12_000, 12_000), now).entry
    Entry.objects.filter(pk=slow.pk).update(is_baseline=True)
    for alias, expected in (("alice", ("steady", 600)), ("carl", ("steady", 850)), ("bob", None)):
        rival = shared_board(race, Racer.objects.get(alias=alias)).rival
        assert (rival and (rival[0].racer.alias, rival[1])) == expected


def test_a_row_opens_its_sectors_and_the_replay_against_the_row_above(race):
    html = page(Racer.objects.get(alias="alice"), race)
    mine = html.partition('class="row-detail" id="about-car-')[2]
    assert "Replay against steady" in html and "Replay against bob" in html and mine
    runs = dict(race.entries.values_list("racer__alias", "best__evaluation__public_id"))
    assert f"{runs['alice']}" in html and f"{runs['steady']}" in html


def test_only_the_racer_sees_the_line_of_their_tries(race, now, django_assert_num_queries):
    alice = Racer.objects.get(alias="alice")
    for number, time in enumerate((12_000, 10_900), 1):
        drive(race, alice, laps(time, time, time), now + timedelta(minutes=number))
    entry = Entry.objects.select_related("race").get(racer=alice)
    with django_assert_num_queries(1):
        assert latest_run(entry, queue=False, tries=True).tries == [11_000, 12_000, 10_900]
    assert "0:11.000 · 0:12.000 · 0:10.900" in page(alice, race)
    assert 'class="spark"' not in page(Racer.objects.get(alias="bob"), race)
