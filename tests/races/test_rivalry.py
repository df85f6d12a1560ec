"""Two racers against each other."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client

from races.duels.rivalry import HeadToHead, head_to_head, rivals_of
from races.entries.services.entries import withdraw
from races.models import DuelCompetitor, Visibility
from tests.duels import drawn, end_all
from tests.factories import a_race, a_racer, drive, lap, laps

pytestmark = pytest.mark.django_db


def test_races_count_where_both_are_classified_and_may_be_seen(alice, bob, charlie, now, wakes):
    for first, second in ((alice, bob), (alice, bob), (bob, alice)):
        race = a_race(now)
        drive(race, first, laps(10_000, 10_000, 10_000), now)
        drive(race, second, laps(11_000, 11_000, 11_000), now)
    unclassified, left = a_race(now), a_race(now)
    for race in (unclassified, left):
        drive(race, alice, laps(10_000, 10_000, 10_000), now)
    drive(unclassified, bob, [lap(1, 9_000, complete=False, percentage=10)], now)
    drive(left, bob, laps(9_000, 9_000, 9_000), now)
    withdraw(entry=left.entries.get(racer=bob), now=now)
    secret = a_race(now, visibility=Visibility.INVITATION, organiser=alice)
    for racer, time in ((alice, 10_000), (charlie, 9_000)):
        if racer == charlie:
            from races.entries.services.entries import enter_race

            enter_race(race=secret, racer=racer, now=now, invited=True)
        drive(secret, racer, laps(time, time, time), now)
    assert head_to_head(alice, bob, None) == HeadToHead(2, 1, 0, 0)
    assert head_to_head(bob, alice, alice) == HeadToHead(1, 2, 0, 0)
    assert not head_to_head(alice, charlie, None).met and not head_to_head(alice, charlie, bob).met
    assert head_to_head(alice, charlie, alice) == HeadToHead(0, 1, 0, 0)
    client = Client()
    assert "You against" not in client.get("/racers/bob/").content.decode()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert "2 : 1" in client.get("/racers/bob/").content.decode()
    assert "You against" not in client.get("/racers/alice/").content.decode()
    enter_race(race=a_race(now), racer=bob, now=now)


def test_heats_count_by_their_places(now, wakes):
    race = drawn(now, 3)
    end_all(race, now)
    one, other = (entry.racer for entry in race.entries.select_related("racer").order_by("pk")[:2])
    mine = dict(DuelCompetitor.objects.filter(entry__racer=one).values_list("duel", "place"))
    theirs = dict(DuelCompetitor.objects.filter(entry__racer=other).values_list("duel", "place"))
    shared = [(mine[duel], theirs[duel]) for duel in mine.keys() & theirs.keys()]
    assert shared
    found = head_to_head(one, other, None)
    assert (found.heats_ahead, found.heats_behind) == (
        sum(a < b for a, b in shared),
        sum(a > b for a, b in shared),
    )


def test_rivals_stand_nearest_on_the_boards_of_the_last_days(
    alice, bob, charlie, now, wakes, django_assert_num_queries
):
    near, far, gone = a_racer("near"), a_racer("far"), a_racer("gone", is_active=False)
    boards = [
        {far: 8_000, charlie: 9_000, near: 9_500, alice: 10_000, bob: 10_500, gone: 10_600},
        {near: 9_500, bob: 10_000, alice: 10_500, far: 30_000},
    ]
    for times in boards:
        race = a_race(now)
        for racer, time in times.items():
            drive(race, racer, laps(time, time, time), now)
    with django_assert_num_queries(4):
        found = rivals_of(alice, alice, now)
    # bob: just behind, just ahead; near: just ahead, two ahead; far: just behind; charlie: two ahead
    assert [(one.rival.alias, one.boards) for one in found] == [("bob", 2), ("near", 2), ("far", 1)]
    assert found[0].record == head_to_head(alice, bob, alice) == HeadToHead(1, 1, 0, 0)
    assert found[1].record == HeadToHead(0, 2, 0, 0)
    assert rivals_of(alice, alice, now + timedelta(days=31)) == [] == rivals_of(a_racer(), alice, now)
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    assert "Your rivals" in client.get("/racers/alice/").content.decode()
    client.force_login(bob, backend="django.contrib.auth.backends.ModelBackend")
    assert "Your rivals" not in client.get("/racers/alice/").content.decode()


def test_of_equals_on_a_board_the_earlier_one_stands_before(alice, bob, charlie, now, wakes):
    race = a_race(now, visibility=Visibility.PUBLIC)
    for racer in (bob, alice, charlie):
        drive(race, racer, laps(10_000, 10_000, 10_000), now)
    assert [one.rival.alias for one in rivals_of(alice, None, now)] == ["bob", "charlie"]
    type(race).objects.update(visibility=Visibility.INVITATION)
    assert rivals_of(alice, None, now) == [] and len(rivals_of(alice, alice, now)) == 2
