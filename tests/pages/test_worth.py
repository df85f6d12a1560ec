"""What the page of a run says first, and to whom."""

from __future__ import annotations

import html
import re
from datetime import timedelta

import pytest
from django.db import transaction
from django.test import Client
from django.utils import timezone

from accounts.models import Racer
from league.models import Round
from races.entries.services.entries import withdraw
from races.models import Entry, Submission
from tests.duels import drawn, end_all
from tests.factories import a_model, a_race, a_racer, drive, lap, laps
from tests.league.seasons import a_season
from tests.pages.conftest import World
from tests.pages.test_queries import LIMIT, queries

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _commits(wakes, monkeypatch):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


@pytest.fixture
def now():
    return timezone.now()


def said(submission: Submission, reader: Racer | None = None) -> str:
    """The words of the strip above a run as ``reader`` sees them."""
    client = Client()
    if reader is not None:
        client.force_login(reader, backend="django.contrib.auth.backends.ModelBackend")
    page = client.get(submission.evaluation.get_absolute_url())
    assert page.status_code == 200
    strip = re.search(r'<section class="card worth".*?</section>', page.content.decode(), re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", strip[0])).split()) if strip else ""


def test_a_race_by_average_shows_the_average_not_the_best_lap(now):
    race, alice = a_race(now), a_racer("alice")
    drive(race, a_racer("bob"), laps(11_000, 11_000, 11_000), now)
    drive(race, a_racer("carol"), laps(11_500, 11_500, 11_500), now)
    drive(race, alice, laps(13_000, 13_000, 13_000), now)
    text = said(drive(race, alice, laps(12_000, 12_500, 12_700), now), alice)
    assert text == (
        "Result Average of 3 laps 0:12.400 Place 3 of 3 Gap ahead +0.900 carol Gap to the leader +1.400 bob "
        "Versus before −0.600 0.600 s faster than before."
    )


def test_a_worse_run_links_to_the_one_that_counts(now):
    race, alice = a_race(now, ranking_method="total"), a_racer("alice")
    drive(race, alice, laps(12_000, 12_000, 12_000), now)
    text = said(drive(race, alice, laps(12_100, 12_100, 12_100), now), alice)
    assert text == (
        "Result Total of 3 laps 0:36.300 Place by submission 1 Only racer on the board "
        "Gap to the leader You lead: no rivals yet "
        "Versus before +0.300 0.300 s slower than before: the board did not change. Counted: submission 1, 0:36.000."
    )


def test_an_unclassified_run_says_what_it_lacks(now):
    race, alice = a_race(now), a_racer("alice")
    drive(race, a_racer("bob"), laps(11_000, 11_000, 11_000), now)
    text = said(drive(race, alice, [lap(1), lap(2, complete=False, percentage=40)], now), alice)
    assert text == (
        "Result Average of 3 laps not classified Complete laps in a row 1 of 3 Your first result in this race."
    )


def test_strangers_and_guests_do_not_see_earlier_results(now):
    race, alice = a_race(now), a_racer("alice")
    drive(race, alice, laps(13_000, 13_000, 13_000), now)
    best = drive(race, alice, laps(12_000, 12_000, 12_000), now)
    for reader in (None, a_racer("bob")):
        text = said(best, reader)
        assert "Place Only racer on the board" in text and "before" not in text and "first result" not in text


def test_the_organiser_does_not_see_words_meant_for_the_racer(now):
    organiser, alice = a_racer("organiser"), a_racer("alice")
    race = a_race(now, organiser=organiser)
    drive(race, alice, laps(12_000, 12_000, 12_000), now)
    worse = drive(race, alice, laps(13_000, 13_000, 13_000), now)
    text = said(worse, organiser)
    assert "Counted: submission 1, 0:12.000." in text and "before" not in text


def test_a_racer_who_left_is_told_so(now):
    race, alice = a_race(now), a_racer("alice")
    submission = drive(race, alice, laps(12_000, 12_000, 12_000), now)
    withdraw(entry=submission.entry, now=now)
    assert "Place has left the race" in said(submission, alice)


def test_a_house_car_is_outside_the_ranking(now):
    race = a_race(now)
    drive(race, a_racer("bob"), laps(12_000, 12_000, 12_000), now)
    house = drive(race, a_racer("house", is_house=True), laps(11_000, 11_000, 11_000), now)
    assert "Place not ranked (house car) Pace 1.000 s faster than the leader, bob" in said(house)


@pytest.mark.parametrize(
    ("place", "words"), [(1, "In the promotion zone by 1 place"), (4, "2 places short of promotion")]
)
def test_a_run_in_a_round_says_how_far_the_line_is(now, place, words):
    race = a_race(now, kind="league", division="open")
    Round.objects.create(season=a_season(promotion_percent=40), number=1, stage="open-qualifier", race=race)
    driven = [drive(race, a_racer(), laps(*[10_000 + n] * 3), now) for n in range(5)]
    assert words in said(driven[place - 1])


def test_a_heat_shows_its_own_result_before_the_race(now):
    race = drawn(now - timedelta(days=1), 3)
    end_all(race, now)
    duel = race.duels.get(round=1, number=1)
    winner = Entry.objects.get(duel_cars__duel=duel, duel_cars__place=1)
    page = Client()
    page.force_login(winner.racer, backend="django.contrib.auth.backends.ModelBackend")
    text = page.get(duel.evaluation.get_absolute_url()).content.decode()
    strip = re.search(r'<section class="card worth".*?</section>', text, re.S)[0]
    words = " ".join(re.sub(r"<[^>]*>", " ", strip).split())
    began = f"Result Racer {winner.racer.alias} Place in this heat 1 of 2 Points in this heat 1 Place in the race"
    assert words.startswith(began)


def test_a_qualifying_run_says_so_once_points_decide(now):
    race = drawn(now - timedelta(days=1), 3)
    end_all(race, now)
    entry = Entry.objects.get(race=race, seed=2)
    text = said(entry.best)
    assert text.startswith("Result Qualifying: Best lap 0:10.100")
    assert "Place in the race 2 of 3 Points 2 Gap to the leader 2 points car-1" in text


def test_a_test_drive_shows_its_best_lap_and_no_place(now):
    alice = a_racer("alice")
    submission = drive(a_race(now), alice, laps(12_000, 12_100, 12_200), now)
    evaluation = submission.evaluation
    Entry.objects.update(best=None)
    submission.delete()
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    page = client.get(evaluation.get_absolute_url()).content.decode()
    assert 'class="card worth"' not in page and '<p class="big-time">0:12.000</p>' in page


def test_a_league_run_that_does_not_count_needs_few_queries(world: World, now):
    Round.objects.create(season=a_season(), number=1, stage="open-qualifier", race=world.race)
    type(world.race).objects.filter(pk=world.race.pk).update(kind="league", division="open")
    for number in range(3):
        drive(world.race, a_racer(), laps(*[10_000 + number] * 3), now)
        a_model(world.alice)
    sent = queries(world.client("alice"), f"/evaluations/{world.other.evaluation.public_id}/")
    assert len(sent) <= LIMIT, "\n".join(sent)


def page_of(submission: Submission, reader: Racer | None) -> str:
    client = Client()
    if reader is not None:
        client.force_login(reader, backend="django.contrib.auth.backends.ModelBackend")
    return client.get(submission.evaluation.get_absolute_url()).content.decode()


def test_after_a_result_the_next_steps_are_to_compare_and_to_train_on(now, monkeypatch):
    race, alice, bob = a_race(now), a_racer("alice"), a_racer("bob")
    leader = drive(race, bob, laps(11_000, 11_000, 11_000), now)
    ahead = drive(race, a_racer("carol"), laps(11_500, 11_500, 11_500), now)
    mine = drive(race, alice, laps(12_000, 12_000, 12_000), now)
    page = page_of(mine, alice)
    assert "Compare with the car ahead" in page and "Train one for this race" in page
    compare = f"/evaluations/{mine.evaluation.public_id}/replay/?with=ahead"
    assert compare in page and f"track={race.track.slug}" in page
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    where = f"/evaluations/{mine.evaluation.public_id}/replay/?with={ahead.evaluation.public_id}"
    assert client.get(compare).headers["Location"] == where
    assert "Compare with the car ahead" in client.get(race.get_absolute_url()).content.decode()
    assert "Train on" not in page_of(mine, bob) and "Compare with the car ahead" in page_of(mine, bob)
    assert "Compare with another run" in page_of(leader, bob)
    monkeypatch.setattr("training.templatetags.training.build_of_model", lambda model: "a network that learns on")
    model = mine.evaluation.model.public_id
    clone = (
        f'href="/train/new/?clone={model}&amp;track={race.track.slug}&amp;direction=ccw&amp;submit_to_race={race.slug}"'
    )
    assert f"{clone}>Train on</a>" in page_of(mine, alice)
    assert f"{clone}>Train on</a>" in client.get(f"{race.get_absolute_url()}live/").content.decode()


def test_a_car_without_a_rank_is_compared_with_the_leader(now):
    race, alice = a_race(now), a_racer("alice")
    leader = drive(race, a_racer("bob"), laps(11_000, 11_000, 11_000), now)
    mine = drive(race, alice, [lap(1), lap(2, complete=False, percentage=40)], now)
    assert "Compare with the leader" in page_of(mine, alice)
    answer = Client().get(f"/evaluations/{leader.evaluation.public_id}/replay/?with=ahead", follow=True)
    assert len(answer.context["runs"]) == 1, "nobody is ahead: the run alone, with the list of others"


def test_the_leader_is_compared_with_the_next_faster_house_car(now):
    race = a_race(now)
    mine = drive(race, a_racer("alice"), laps(12_000, 12_000, 12_000), now)
    drive(race, a_racer("flyer", is_house=True), laps(10_000, 10_000, 10_000), now)
    brisk = drive(race, a_racer("brisk", is_house=True), laps(11_000, 11_000, 11_000), now)
    drive(race, a_racer("steady", is_house=True), laps(13_000, 13_000, 13_000), now)
    answer = Client().get(f"/evaluations/{mine.evaluation.public_id}/replay/?with=ahead")
    assert brisk.evaluation.public_id in answer.headers["Location"]


def test_a_house_car_is_compared_with_the_leader_in_words(now):
    race = a_race(now)
    drive(race, a_racer("kay"), laps(12_000, 12_000, 12_000), now)
    fast = drive(race, a_racer("flyer", is_house=True), laps(10_000, 10_000, 10_000), now)
    slow = drive(race, a_racer("brisk", is_house=True), laps(13_000, 13_000, 13_000), now)
    assert "2.000 s faster than the leader, kay" in said(fast) and "not ranked (house car)" in said(fast)
    assert "1.000 s slower than the leader, kay" in said(slow) and "Gap to the leader" not in said(slow)


def test_a_racer_without_rivals_is_neither_one_of_one_nor_leader(now, settings):
    race, alice = a_race(now, minimum_laps=1), a_racer("alice")
    drive(race, a_racer("flyer", is_house=True), laps(10_000, 10_000, 10_000), now)
    mine = drive(race, alice, laps(29_000, 30_000, 31_000), now)
    assert "Only racer on the board" in said(mine, alice) and "You lead: no rivals yet" in said(mine, alice)
    assert "no rivals yet" in said(mine, a_racer("bob")) and "You lead" not in said(mine, a_racer("carol"))
    client = Client()
    client.force_login(alice, backend="django.contrib.auth.backends.ModelBackend")
    board = client.get(race.get_absolute_url()).content.decode()
    words = " ".join(re.sub(r"<[^>]*>", " ", board).split())
    assert "1 of 1" not in words and "leader" not in words and "Position Only racer on the board" in words
    drive(race, a_racer("dan"), laps(32_000, 33_000, 34_000), now)
    words = " ".join(re.sub(r"<[^>]*>", " ", client.get(race.get_absolute_url()).content.decode()).split())
    assert "leader" in words and "Position 1 of 2" in words


@pytest.mark.parametrize("method", ["average", "best", "total"])
def test_an_average_of_one_lap_does_not_repeat_the_best_lap(now, method):
    one = {"minimum_laps": 1} | ({"laps": 1} if method == "total" else {})
    for rules, has_average in ((one, False), ({"minimum_laps": 3}, True)):
        race = a_race(now, ranking_method=method, **rules)
        drive(race, a_racer(f"racer-{race.minimum_laps}"), laps(*(12_000, 12_500, 12_700)[: race.laps]), now)
        head = re.search(r"<thead>.*?</thead>", Client().get(race.get_absolute_url()).content.decode(), re.S)[0]
        assert (">Average</th>" in head) is has_average
        assert head.count("aria-sort") == 1
        assert (">Best lap</th>" in head) is (has_average or method != "total")
