"""Standings: what ended evaluations change, in whatever order they end."""

from __future__ import annotations

import itertools
import random
from datetime import timedelta

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evaluation.models import Result
from evaluation.running.queue.jobs import finish_evaluation
from evaluation.running.queue.services import queue_evaluation, stop_evaluation
from evaluation.signals import evaluation_ended
from paddock.errors import UserFault
from paddock.rules.race import RaceRules
from races.boards.selectors.board import board
from races.entries.services import standings
from races.entries.services.entries import enter_race, withdraw
from races.entries.services.standings import FASTEST, recompute_race, record_ended_evaluation
from races.models import Entry, Race, Submission
from races.rules.layout import race_rules
from tests.factories import a_model, a_race, a_racer, drive, fail, finish, lap, laps, outcome, start
from tests.soak import examples

pytestmark = pytest.mark.django_db

STANDING = (
    "best_id",
    "classified",
    "score_ms",
    "average_ms",
    "best_lap_ms",
    "total_ms",
    "complete_laps",
    "off_tracks",
    "resets",
    "sectors",
    "achieved_at",
    "rank_score",
    "rank_lap",
    *FASTEST.values(),
)


def standing_of(entry: Entry) -> dict:
    return Entry.objects.values(*STANDING).get(pk=entry.pk)


def submitted(entry: Entry, at) -> Submission:
    """A submission that waits, made beside the service so that several can wait at once."""
    model = a_model(entry.racer)
    entry.submission_count += 1
    entry.last_number += 1
    entry.save(update_fields=["submission_count", "last_number"])
    return Submission.objects.create(
        entry=entry,
        number=entry.last_number,
        network_id=model.network_id,
        submitted_at=at,
        evaluation=queue_evaluation(
            owner=entry.racer, model=model, track=entry.race.track, rules=race_rules(entry.race), now=at
        ),
    )


def test_a_result_writes_the_standing_in_its_own_transaction(alice, now):
    race = a_race(now)
    submission = drive(race, alice, laps(9_300, 9_000, 9_100, resets=2), now)
    entry = Entry.objects.get(race=race)
    assert entry.classified and entry.best == submission
    assert (entry.score_ms, entry.average_ms, entry.best_lap_ms, entry.total_ms) == (9_133, 9_133, 9_000, 27_400)
    assert (entry.complete_laps, entry.resets, entry.achieved_at) == (3, 2, now)
    assert entry.sectors == [3_000, 3_000, 3_000]


def test_a_result_is_not_written_without_its_standing(alice, now, monkeypatch):
    def broken(*args):
        raise RuntimeError("no standing today")

    race = a_race(now)
    submission = drive_later(race, alice, now)
    monkeypatch.setattr(standings, "_improve", broken)
    with pytest.raises(RuntimeError):
        finish(submission, laps(9_000, 9_000, 9_000), now)
    submission.evaluation.refresh_from_db()
    assert not Result.objects.exists()
    assert submission.evaluation.state == "running", "it will be tried again"


def drive_later(race: Race, racer, now):
    return submitted(enter_race(race=race, racer=racer, now=now), now)


def test_a_worse_submission_changes_only_the_count(alice, now):
    race = a_race(now)
    best = drive(race, alice, laps(9_000, 9_000, 9_000), now)
    before = standing_of(best.entry)
    drive(race, alice, laps(9_500, 9_500, 9_500), now + timedelta(hours=1))
    assert standing_of(best.entry) == before
    assert Entry.objects.get(race=race).submission_count == 2


def test_a_better_submission_replaces_the_standing_as_a_whole(alice, now):
    race = a_race(now)
    drive(race, alice, laps(9_900, 8_000, 9_900), now)
    better = drive(race, alice, laps(9_000, 9_000, 9_000, resets=1), now + timedelta(hours=1))
    entry = Entry.objects.get(race=race)
    assert (entry.best, entry.best_lap_ms, entry.resets) == (better, 9_000, 1)
    assert entry.own_lap_ms == 8_000, "the racer's personal best lap is of all submissions"


def test_a_classified_car_is_never_replaced_by_an_unclassified_one(alice, now):
    race = a_race(now)
    drive(race, alice, laps(60_000, 60_000, 60_000), now)
    drive(race, alice, [*laps(5_000, 5_000), lap(3, 10, complete=False, percentage=99)], now)
    entry = Entry.objects.get(race=race)
    assert entry.classified and entry.score_ms == 60_000


def test_equal_results_keep_the_earlier_submission(alice, now):
    race = a_race(now)
    entry = enter_race(race=race, racer=alice, now=now)
    later, earlier = submitted(entry, now + timedelta(hours=1)), submitted(entry, now)
    finish(later, laps(9_000, 9_000, 9_000), now)
    finish(earlier, laps(9_000, 9_000, 9_000), now)
    entry.refresh_from_db()
    assert (entry.best, entry.achieved_at) == (earlier, now)


def test_recording_a_result_twice_changes_nothing(alice, now):
    race = a_race(now)
    submission = drive(race, alice, laps(9_000, 9_100, 9_200), now)
    before = standing_of(submission.entry), Race.objects.values().get(pk=race.pk)
    for _ in range(2):
        evaluation_ended.send(
            sender=None, evaluation=submission.evaluation, result=submission.evaluation.result, now=now
        )
    assert (standing_of(submission.entry), Race.objects.values().get(pk=race.pk)) == before


def test_a_refund_recorded_twice_is_given_once(alice, now):
    race = a_race(now)
    entry = enter_race(race=race, racer=alice, now=now)
    submitted(entry, now)
    second = submitted(entry, now)
    stop_evaluation(evaluation=second.evaluation, now=now)
    for _ in range(2):
        record_ended_evaluation(evaluation=second.evaluation, result=None, now=now)
    entry.refresh_from_db()
    assert (entry.submission_count, entry.last_number) == (1, 2)


def test_an_evaluation_outside_any_race_changes_no_race(alice, oval, now):
    evaluation = queue_evaluation(owner=alice, model=a_model(alice), track=oval, rules=RaceRules(), now=now)
    running = start(evaluation, now)
    done = outcome(laps(9_000))
    assert finish_evaluation(pk=running.pk, lease=running.lease, outcome=done, now=now)
    assert not Entry.objects.exists()


submissions = st.lists(
    st.tuples(
        st.lists(st.integers(8_000, 8_010), min_size=0, max_size=3),  # close together, so that ties happen
        st.integers(0, 2),  # resets
        st.integers(0, 3),  # submitted at
        st.booleans(),  # the last lap is complete
    ),
    min_size=1,
    max_size=5,
)


@settings(max_examples=examples(25), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(submissions, st.randoms(use_true_random=False))
def test_standings_do_not_depend_on_the_order_of_results(now, sent, rng: random.Random):
    race = a_race(now)
    boards = []
    for order in (list(range(len(sent))), rng.sample(range(len(sent)), len(sent))):
        racer = a_racer()
        entry = enter_race(race=race, racer=racer, now=now)
        waiting = [submitted(entry, now + timedelta(minutes=minute)) for _, _, minute, _ in sent]
        for index in order:
            times, resets, _, whole = sent[index]
            driven = laps(*times, resets=resets)
            if driven and not whole:
                driven[-1] |= {"complete": False, "completion_percentage": 50, "sector_ms": []}
            finish(waiting[index], driven, now)
        incremental = standing_of(entry)
        recompute_race(race=race)
        assert standing_of(entry) == incremental, "keeping the best is the same as working all out anew"
        assert incremental["best_id"] is not None
        incremental["best_id"] = next(n for n, one in enumerate(waiting) if one.pk == incremental["best_id"])
        boards.append(incremental)
    assert boards[0] == boards[1]


def test_board_and_fastest_times_ignore_the_finishing_order(now):
    runs = {"a": (9_000, 9_100, 9_000), "b": (8_900, 9_300, 9_000), "c": (9_000, 9_100, 9_000)}
    seen = []
    for order in itertools.permutations(runs):
        race = a_race(now)
        racers = {name: a_racer() for name in runs}
        waiting = {
            name: submitted(enter_race(race=race, racer=racers[name], now=now), now + timedelta(seconds=n))
            for n, name in enumerate(runs)
        }
        for name in order:
            finish(waiting[name], laps(*runs[name]), now)
        race.refresh_from_db()
        names = {racer.pk: name for name, racer in racers.items()}
        ranking = [(row.rank, names[row.racer.pk], row.gap_ms) for row in board(race).rows]
        seen.append((ranking, race.fastest_lap_ms, race.fastest_sectors_ms))
    assert all(each == seen[0] for each in seen)
    assert [name for _, name, _ in seen[0][0]] == ["a", "c", "b"]
    assert seen[0][1] == 8_900


def test_only_ranked_cars_set_the_fastest_times(alice, bob, now):
    race = a_race(now)
    house = a_racer(is_house=True)
    drive(race, house, laps(1_000, 1_000, 1_000), now)
    race.refresh_from_db()
    assert race.fastest_lap_ms is None, "house cars set no marks"
    drive(race, alice, laps(9_000, 8_500, 9_000), now)
    fast = drive(race, bob, laps(8_000, 9_000, 9_000), now)
    race.refresh_from_db()
    assert race.fastest_lap_ms == 8_000
    withdraw(entry=fast.entry, now=now)
    race.refresh_from_db()
    assert race.fastest_lap_ms == 8_500, "who leaves takes their marks along"
    enter_race(race=race, racer=bob, now=now)
    race.refresh_from_db()
    assert race.fastest_lap_ms == 8_000, "and brings them back"


def test_a_result_after_withdrawal_is_kept_but_sets_no_marks(alice, now):
    race = a_race(now)
    submission = drive_later(race, alice, now)
    Entry.objects.filter(pk=submission.entry_id).update(withdrawn_at=now)
    finish(submission, laps(9_000, 9_000, 9_000), now)
    race.refresh_from_db()
    assert race.fastest_lap_ms is None
    assert board(race).rows == []
    enter_race(race=race, racer=alice, now=now)
    assert [row.alias for row in board(race).rows] == ["alice"]


def test_a_race_can_be_recomputed(alice, bob, now):
    race = a_race(now)
    drive(race, alice, laps(9_000, 9_000, 9_000), now)
    drive(race, bob, laps(9_500, 9_500, 9_500), now)
    fail(drive_later(race, a_racer(), now), UserFault("non_finite_action", step=1), now)
    before = list(Entry.objects.order_by("pk").values(*STANDING)), Race.objects.values().get(pk=race.pk)
    Race.objects.update(fastest_lap_ms=1)
    Entry.objects.filter(racer=bob).update(own_lap_ms=5)
    assert recompute_race(race=race) == 3
    after = list(Entry.objects.order_by("pk").values(*STANDING)), Race.objects.values().get(pk=race.pk)
    assert after == before
