"""What a finished run is worth in its race: by every ranking method, in duels, unclassified, tied and alone."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import transaction

from races.boards.improvement import Change, ChangeKind, change, sentence
from races.boards.ranking import RULES
from races.boards.selectors.board import board
from races.boards.selectors.results import heat_of, place_of, result_of
from races.entries.services.entries import withdraw
from races.models import Entry, Race, Submission
from races.rules.descriptions import behind, score_name
from tests.duels import drawn, driving, end, end_all
from tests.factories import a_race, a_racer, drive, lap, laps
from tests.league.test_telling_costs import read_whole

pytestmark = pytest.mark.django_db

ALICE, BOB, CAROL = (12_000, 12_600, 12_900), (11_500, 12_300, 12_500), (11_000, 12_000, 12_100)
LOST = [lap(1, 9_000), lap(2, 5_000, complete=False, percentage=40)]


@pytest.fixture(autouse=True)
def _commits(monkeypatch):
    monkeypatch.setattr(transaction, "on_commit", lambda call, **options: call())


def worth(submission: Submission, *, with_earlier: bool = True):
    submission = Submission.objects.select_related("entry__race", "evaluation__result").get(pk=submission.pk)
    return result_of(submission, submission.evaluation.result.laps, with_earlier=with_earlier)


def gaps(found) -> tuple:
    return tuple(one and (one.entry.racer.alias, one.gap) for one in (found.place.ahead, found.place.leader))


@pytest.mark.parametrize(
    ("method", "name", "score", "to_bob", "to_carol"),
    [
        ("average", "Average of 3 laps", 12_500, 400, 800),
        ("best", "Best lap", 12_000, 500, 1_000),
        ("total", "Total of 3 laps", 37_500, 1_200, 2_400),
    ],
)
@pytest.mark.parametrize(
    "of_type",
    [
        {},
        {"race_type": "object_avoidance", "random_boxes": 2},
        {"race_type": "head_to_head", "opponents": "bots", "bots": 2},
    ],
    ids=["time-trial", "boxes", "bots"],
)
def test_every_method_gives_score_place_and_gaps(now, of_type, method, name, score, to_bob, to_carol):
    race = a_race(now, ranking_method=method, **of_type)
    drive(race, a_racer("carol"), laps(*CAROL), now)
    drive(race, a_racer("bob"), laps(*BOB), now)
    drive(race, a_racer("house", is_house=True), laps(11_999, 11_999, 11_999), now)
    found = worth(drive(race, a_racer("alice"), laps(*ALICE), now))
    assert (score_name(race), found.standing.score_ms, found.counts) == (name, score, True)
    assert (found.place.rank, found.place.totals.racers, found.place.totals.classified) == (3, 3, 3)
    assert gaps(found) == (("bob", to_bob), ("carol", to_carol)), "house cars are nobody's rivals"
    assert found.change == Change(ChangeKind.FIRST)
    row = next(row for row in board(race).rows if row.alias == "alice")
    assert (row.rank, row.gap_ms) == (found.place.rank, found.place.leader.gap), "as the board says it"


def test_the_leader_has_no_car_ahead(now):
    race = a_race(now)
    found = worth(drive(race, a_racer("alice"), laps(*ALICE), now))
    assert (found.place.rank, found.place.totals.racers, gaps(found)) == (1, 1, (None, None))
    second = worth(drive(race, a_racer("late"), laps(13_000, 13_000, 13_000), now))
    assert gaps(second) == (("alice", 500), ("alice", 500))


def test_an_equal_car_ahead_is_named_with_a_zero_gap(now):
    race = a_race(now)
    for number in range(4):
        drive(race, a_racer(f"twin-{number}"), laps(*ALICE), now + timedelta(minutes=number))
    drive(race, a_racer("neater"), laps(12_400, 12_500, 12_600), now)  # the same average, a slower best lap
    drive(race, a_racer("quick"), laps(*BOB), now)
    found = {row.alias: worth(row.entry.best) for row in board(race).rows}
    assert {name: (one.place.rank, *gaps(one)) for name, one in found.items()} == {
        "quick": (1, None, None),
        "twin-0": (2, ("quick", 400), ("quick", 400)),
        "twin-1": (3, ("twin-0", 0), ("quick", 400)),
        "twin-2": (4, ("twin-1", 0), ("quick", 400)),
        "twin-3": (5, ("twin-2", 0), ("quick", 400)),
        "neater": (6, ("twin-3", 0), ("quick", 400)),
    }


def test_an_unclassified_car_has_no_place_but_says_what_it_lacks(now):
    race = a_race(now)
    drive(race, a_racer("bob"), laps(*BOB), now)
    found = worth(drive(race, a_racer("alice"), LOST, now))
    assert (found.standing.classified, found.streak, found.place.rank, found.counts) == (False, 1, None, True)
    assert found.place.ahead is None and found.place.leader.gap is None


def test_a_worse_result_says_what_counts_instead(now):
    race, alice = a_race(now), a_racer("alice")
    drive(race, a_racer("carol"), laps(*CAROL), now)
    first = drive(race, alice, laps(*ALICE), now)
    found = worth(drive(race, alice, laps(13_000, 13_000, 13_000), now))
    assert (found.counts, found.instead, found.was_overtaken, found.earlier) == (False, first, False, 1)
    assert found.change == Change(ChangeKind.SLOWER, 500)
    assert found.change.sentence == "0.500 s slower than before: the board did not change."
    assert (found.place.rank, gaps(found)[1]) == (2, ("carol", 800)), "the place is of the run that counts"


def test_a_result_is_compared_with_the_best_before_it(now):
    race, alice = a_race(now), a_racer("alice")
    drive(race, alice, laps(*ALICE), now)
    drive(race, alice, laps(13_000, 13_000, 13_000), now)
    better = drive(race, alice, laps(*BOB), now)
    assert worth(better).change == Change(ChangeKind.FASTER, 400)
    assert worth(better).change.sentence == "0.400 s faster than before."
    best = drive(race, alice, laps(*CAROL), now)
    found = worth(better)
    assert (found.change, found.counts, found.instead, found.was_overtaken) == (
        (ChangeKind.FASTER, 400),
        False,
        best,
        True,
    )


def test_only_the_racer_sees_their_earlier_results(now):
    race, alice = a_race(now), a_racer("alice")
    drive(race, alice, laps(13_000, 13_000, 13_000), now)
    found = worth(drive(race, alice, laps(*ALICE), now), with_earlier=False)
    assert (found.change, found.earlier, found.place.rank) == (None, None, 1)


def test_a_void_run_counts_for_nothing(now):
    submission = drive(a_race(now), a_racer(), laps(*ALICE), now)
    Submission.objects.filter(pk=submission.pk).update(is_void=True)
    assert worth(submission) is None


def test_a_racer_who_left_has_no_place_or_gaps(now):
    race = a_race(now)
    drive(race, a_racer("bob"), laps(*BOB), now)
    submission = drive(race, a_racer("alice"), laps(*ALICE), now)
    withdraw(entry=submission.entry, now=now)
    found = worth(submission)
    assert (found.place.rank, gaps(found), found.standing.score_ms) == (None, (None, None), 12_500)


def test_a_house_car_has_no_place_but_a_gap_to_the_leader(now):
    race = a_race(now)
    drive(race, a_racer("bob"), laps(*BOB), now)
    found = worth(drive(race, a_racer("house", is_house=True), laps(*CAROL), now))
    assert (found.place.rank, gaps(found)) == (None, (None, ("bob", -400)))


RULE = RULES["average"]


@pytest.mark.parametrize(
    ("driven", "before", "expected"),
    [
        (laps(9_000, 9_000, 9_000), None, (ChangeKind.FIRST, 0)),
        (laps(9_000, 9_000, 9_000), laps(9_300, 9_300, 9_300), (ChangeKind.FASTER, 300)),
        (laps(9_300, 9_300, 9_300), laps(9_000, 9_000, 9_000), (ChangeKind.SLOWER, 300)),
        (laps(9_000, 9_000, 9_000), laps(9_000, 9_000, 9_000), (ChangeKind.SAME, 0)),
        (laps(8_900, 9_000, 9_100), laps(9_000, 9_000, 9_000), (ChangeKind.TIE_WON, 0)),
        (laps(9_000, 9_000, 9_000), laps(8_900, 9_000, 9_100), (ChangeKind.SAME, 0)),
        (laps(9_000, 9_000, 9_000), laps(9_000, 9_000, 9_000, resets=1), (ChangeKind.TIE_WON, 0)),
        (laps(9_000, 9_000, 9_000), LOST, (ChangeKind.CLASSIFIED, 0)),
        (LOST, laps(90_000, 90_000, 90_000), (ChangeKind.LOST, 0)),
        (LOST, laps(9_000), (ChangeKind.FARTHER, 40)),
        (laps(9_000), LOST, (ChangeKind.LESS_FAR, 40)),
        (LOST, LOST, (ChangeKind.SAME, 0)),
    ],
)
def test_results_of_a_racer_compare_as_on_the_board(driven, before, expected):
    standings = [None if one is None else RULE.standing(one, 3) for one in (driven, before)]
    found = change(*standings)
    assert found == expected
    says_unchanged = "did not change" in sentence(*found)
    assert says_unchanged is not found.is_better and found.sentence
    if before is not None:
        assert found.is_better is (standings[0].key < standings[1].key)


def test_every_kind_of_change_has_a_sentence():
    assert all(sentence(kind, 1_234) for kind in ChangeKind)
    assert sentence("of a later version", 1) == ""


def test_once_duels_are_drawn_gaps_are_in_points(now):
    race = drawn(now, 3)
    end_all(race, now)
    places = {entry.racer.alias: place_of(entry) for entry in Entry.objects.filter(race=race).select_related("race")}
    told = {
        name: (one.rank, one.entry.points, *(rival and behind(one, rival) for rival in (one.ahead, one.leader)))
        for name, one in places.items()
    }
    assert told == {
        "car-1": (1, 4, None, None),
        "car-2": (2, 2, "2 points", "2 points"),
        "car-3": (3, 0, "2 points", "4 points"),
    }


def test_in_a_bracket_gaps_are_in_ties(now):
    race = drawn(now, 4, duel_format="bracket")
    end_all(race, now)
    entries = Entry.objects.filter(race=race).select_related("race").order_by("rank_score", "rank_lap")
    told = [(one := place_of(entry)) and (one.ahead and behind(one, one.ahead)) for entry in entries]
    assert told == [None, "1 duel", "1 duel", "duels won equal"]


def test_a_heat_shows_its_own_place_and_that_in_the_race(now):
    race = drawn(now, 3)
    duel = driving(race)[0]
    ids = dict(duel.cars.values_list("entry__seed", "entry__racer"))
    assert heat_of(duel, min(ids.values())) is None, "not decided yet"
    end(duel, now)
    first, second = (heat_of(duel, ids[seed]) for seed in sorted(ids))
    assert (first.car.place, first.car.points, first.cars, first.place.rank) == (1, 1, 2, 1)
    assert (second.car.place, second.car.points, second.place.entry.points) == (2, 0, 0)
    assert first.place.entry.points == 1
    assert heat_of(duel, a_racer().pk) is None


def test_a_car_that_was_not_drawn_has_no_gap_to_drawn_ones(now, settings):
    settings.DUELS_IN_ROUND_ROBIN = 2
    race = drawn(now, 4)
    third, fourth = (Entry.objects.select_related("race").get(race=race, racer__alias=f"car-{n}") for n in (3, 4))
    assert (third.seed, place_of(third).ahead.gap, place_of(third).leader.gap) == (None, None, None)
    assert (place_of(fourth).rank, place_of(fourth).ahead.gap) == (4, 100)


def test_a_longer_board_needs_no_more_queries(now, django_assert_num_queries):
    race: Race = a_race(now)
    for number in range(12):
        drive(race, a_racer(), laps(*[10_000 + 10 * number] * 3), now)
    submission = drive(race, a_racer("alice"), laps(*ALICE), now)
    submission = Submission.objects.select_related("entry__race", "evaluation__result").get(pk=submission.pk)
    driven = submission.evaluation.result.laps
    with django_assert_num_queries(4):
        assert result_of(submission, driven, with_earlier=True).place.rank == 13
    assert read_whole(lambda: result_of(submission, driven, with_earlier=True)) == set()
