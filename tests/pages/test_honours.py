"""What a racer's page says that they have won, and what a bracket's board says it counts."""

from __future__ import annotations

import re
from datetime import timedelta

import pytest
from django.db import transaction
from django.utils import timezone

from evaluation.models import State
from league.racers.selectors import Honours, honours_of
from league.stewarding.official_results import close_round
from races.entries.selectors.lists import racer_history
from races.entries.selectors.visibility import races_visible_to
from races.entries.services.entries import withdraw
from races.entries.services.submissions import submit_model
from races.models import Entry, Race, Visibility
from tests.duels import drawn, end_all
from tests.factories import a_model, a_race, a_racer, drive, finish, lap, laps
from tests.league.seasons import a_round, a_season, after, board

pytestmark = pytest.mark.django_db
QUICK, SLOW = laps(9_000, 9_000, 9_000), laps(9_500, 9_500, 9_500)
LOST = [lap(1, 9_000, complete=False, percentage=40)]


@pytest.fixture(autouse=True)
def _commits(wakes, monkeypatch):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


@pytest.fixture
def now():
    return timezone.now() - timedelta(days=30)


def closed_race(now, *results, racer, **fields) -> Race:
    """A race that has closed: ``racer`` drove QUICK, others these results."""
    race = a_race(now, closes_at=now + timedelta(hours=1), **fields)
    drive(race, racer, QUICK, now)
    for driven in results:
        drive(race, a_racer(), driven, now)
    return race


def won(racer, viewer=None) -> tuple[int, int, int]:
    found = honours_of(racer, races_visible_to(viewer), timezone.now())
    return found.races, found.wins, found.podiums


def test_a_win_needs_a_closed_race_with_two_classified_racers(now):
    alice = a_racer("alice")
    closed_race(now, SLOW, racer=alice)
    assert won(alice) == (1, 1, 1)


def test_leading_an_open_race_is_not_a_win(now):
    alice = a_racer("alice")
    race = a_race(now, closes_at=timezone.now() + timedelta(days=1))
    drive(race, alice, QUICK, now)
    drive(race, a_racer(), SLOW, now)
    assert won(alice) == (1, 0, 0)


def test_the_only_classified_racer_does_not_win(now):
    alice = a_racer("alice")
    race = closed_race(now, LOST, racer=alice)
    drive(race, a_racer("house", is_house=True), SLOW, now)
    assert won(alice) == (1, 0, 0)


def test_a_race_with_a_waiting_car_is_not_yet_won(now):
    alice, bob = a_racer("alice"), a_racer("bob")
    race = a_race(now, closes_at=now + timedelta(hours=1))
    drive(race, alice, QUICK, now)
    drive(race, a_racer(), SLOW, now)
    late = submit_model(race=race, racer=bob, model=a_model(bob), now=now)
    assert late.evaluation.state == State.QUEUED
    assert won(alice) == (1, 0, 0)
    finish(late, laps(8_000, 8_000, 8_000), timezone.now())
    assert (won(alice), won(bob)) == ((1, 0, 1), (1, 1, 1))


def test_cancelled_and_withdrawn_races_are_not_wins(now):
    alice = a_racer("alice")
    cancelled = closed_race(now, SLOW, racer=alice)
    Race.objects.filter(pk=cancelled.pk).update(cancelled_at=now, cancel_reason="Rain.")
    left = a_race(now, closes_at=now + timedelta(hours=1))
    withdraw(entry=drive(left, alice, QUICK, now).entry, now=now)
    assert won(alice) == (1, 0, 0)


def test_a_win_in_a_hidden_race_is_not_shown_to_others(now):
    alice = a_racer("alice")
    Race.objects.filter(pk=closed_race(now, SLOW, racer=alice).pk).update(visibility=Visibility.INVITATION)
    assert (won(alice), won(alice, alice)) == ((0, 0, 0), (1, 1, 1))


def test_a_race_of_duels_is_won_when_the_last_duel_is_over(now):
    race = drawn(now, 3)
    first = Entry.objects.get(race=race, seed=1).racer
    assert won(first) == (1, 0, 0), "the qualifying is no result"
    end_all(race, now)
    assert won(first) == (1, 1, 1)


def test_a_round_is_won_when_it_is_official(now):
    alice = a_racer("alice")
    round_ = a_round(a_season(), 1, "open-qualifier")
    board(round_.race, [alice, a_racer()])
    assert won(alice) == (1, 0, 0)
    close_round(round=round_, now=after(round_))
    assert won(alice) == (1, 1, 1)


def test_the_page_counts_all_races_not_only_those_listed(client, now, monkeypatch):
    monkeypatch.setattr(racer_history, "__defaults__", (None, 2))
    alice = a_racer("alice")
    for _ in range(3):
        closed_race(now, SLOW, racer=alice)
    html = re.sub(r">\s+<", "><", client.get("/racers/alice/").content.decode())
    assert "<dt>Races</dt><dd>3</dd><dt>Wins</dt><dd>3</dd><dt>Podiums</dt><dd>3</dd>" in html
    assert "the last 2" in html


def test_more_wins_need_no_more_queries(django_assert_num_queries, now):
    alice = a_racer("alice")
    for _ in range(3):
        closed_race(now, SLOW, racer=alice)
    with django_assert_num_queries(3):
        assert honours_of(alice, races_visible_to(None), timezone.now()) == Honours(3, 3, 3)


def test_a_bracket_says_that_it_counts_ties(client, now):
    race = drawn(now, 4, duel_format="bracket")
    end_all(race, now)
    html = client.get(f"/races/{race.slug}/").content.decode()
    assert ">Duels won</th>" in html and ">Points</th>" not in html
    assert "2 duels won" in client.get("/racers/car-1/").content.decode()
    assert "2 duels won" in client.get(f"/races/{race.slug}/badge.svg").content.decode()


def test_a_round_robin_says_that_it_counts_points(client, now):
    race = drawn(now, 2)
    end_all(race, now)
    assert ">Points</th>" in client.get(f"/races/{race.slug}/").content.decode()
    assert re.search(r"\d points?", client.get("/racers/car-1/").content.decode())
