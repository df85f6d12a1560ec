"""Two racers against each other."""

from __future__ import annotations

import pytest
from django.test import Client

from races.models import DuelCompetitor, Visibility
from races.selectors.rivalry import HeadToHead, head_to_head
from races.services import enter_race, withdraw
from tests.duels import drawn, end_all
from tests.factories import a_race, drive, lap, laps

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
            from races.services.entries import enter_as_invited

            enter_as_invited(race=secret, racer=racer, now=now)
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
