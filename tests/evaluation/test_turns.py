"""Racers take turns, what hurries goes first, and the queue costs the same however long it is."""

from __future__ import annotations

import threading
from datetime import timedelta

import pytest
from django.db import IntegrityError, connections, transaction

from evaluation.models import Evaluation, State
from evaluation.running.queue import order as queue_order
from evaluation.running.queue import selectors
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from evaluation.running.queue.order import URGENT
from evaluation.running.queue.services import queue_copies, queue_evaluation, stop_evaluation
from evaluation.running.queue.turns import reschedule
from evaluation.templatetags.queue import done_in, in_queue, place
from paddock.rules.race import RaceRules
from tests.evaluation.stubs import outcome_of
from tests.rows import model_row

HOUR = timedelta(hours=1)


@pytest.fixture
def submit(oval, wakes, now):
    """Queue an evaluation ``after`` seconds from now, of a race that closes at ``closes_at``."""

    def queue(racer, after=0, **options):
        model = racer.models.first() or model_row(racer)
        at = now + timedelta(seconds=after)
        return queue_evaluation(owner=racer, model=model, track=oval, rules=RaceRules(), now=at, **options)

    return queue


def run_next(now):
    """Run what is next; whose it was."""
    evaluation = EVALUATIONS.claim(worker="w", now=now)
    finish_evaluation(pk=evaluation.pk, lease=evaluation.lease, outcome=outcome_of(), now=now)
    return evaluation.owner.alias


class TestTurns:
    def test_a_newcomer_waits_for_one_car_of_a_flood_at_most(self, alice, bob, submit, now):
        for second in range(6):
            submit(alice, second)
        assert [run_next(now) for _ in range(3)] == ["alice"] * 3
        submit(bob, 60)
        assert "bob" in [run_next(now), run_next(now)]

    def test_steady_submitters_do_not_block_anothers_second_car(self, alice, bob, charlie, submit, now):
        submit(alice), submit(alice, 1)
        submit(bob, 2), submit(charlie, 3)
        ran = []
        for second in range(10, 16):
            ran.append(run_next(now))
            if ran[-1] != "alice":  # they always have exactly one
                submit({"bob": bob, "charlie": charlie}[ran[-1]], second)
        assert ran.count("alice") == 2

    def test_a_withdrawn_car_costs_no_turn(self, alice, bob, submit, now):
        for second in range(5):
            stop_evaluation(evaluation=submit(alice, second), now=now)
        mine, other = submit(alice, 10), submit(bob, 11)
        assert (selectors.queue_position(mine), selectors.queue_position(other)) == (1, 2)

    def test_an_empty_queue_resets_the_turns(self, alice, bob, submit, now):
        for second in range(5):
            submit(alice, second)
        for _ in range(5):
            run_next(now)
        submit(alice, 60), submit(bob, 61)
        assert run_next(now) == "alice"

    def test_the_database_holds_one_car_per_racer_and_turn(self, alice, submit):
        first = submit(alice)
        with pytest.raises(IntegrityError), transaction.atomic():
            Evaluation.objects.filter(pk=submit(alice, 1).pk).update(turn=first.turn)

    def test_a_car_queued_by_an_older_release_gets_its_turn(self, alice, bob, submit, now):
        fields = {"model": model_row(alice), "track": submit(bob).track, "spec": {}, "queued_at": now}
        old = [Evaluation.objects.create(owner=alice, **fields) for _ in range(2)]
        EVALUATIONS.sweep(now=now)
        for one in old:
            one.refresh_from_db()
        assert old[0].turn is not None and old[1].turn == old[0].turn + 1


@pytest.mark.django_db(transaction=True)
def test_cars_queued_together_get_successive_turns(alice, submit):
    model_row(alice)
    ready, failed = threading.Barrier(4), []

    def queue_one():
        try:
            ready.wait()
            submit(alice)
        except Exception as error:
            failed.append(error)
            raise
        finally:
            connections.close_all()

    threads = [threading.Thread(target=queue_one) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed
    turns = sorted(Evaluation.objects.values_list("turn", flat=True))
    assert turns == list(range(turns[0], turns[0] + 4))


class TestUrgency:
    def test_a_race_closing_within_the_hour_goes_first(self, alice, bob, submit, now):
        submit(alice)
        hurried = submit(bob, 10, closes_at=now + HOUR)
        assert selectors.queue_position(hurried) == 1
        assert run_next(now) == "bob"

    def test_waiting_cars_move_up_in_their_races_last_hour(self, alice, bob, submit, now):
        submit(alice)
        waiting = submit(bob, 10, closes_at=now + 2 * HOUR)
        EVALUATIONS.sweep(now=now + HOUR - timedelta(seconds=1))
        assert selectors.queue_position(waiting) == 2
        EVALUATIONS.sweep(now=now + HOUR)
        assert selectors.queue_position(waiting) == 1

    def test_racers_take_turns_among_urgent_runs_too(self, alice, bob, submit, now):
        for second in range(3):
            submit(alice, second, closes_at=now + 2 * HOUR)
        submit(bob, 20, closes_at=now + 2 * HOUR)
        EVALUATIONS.sweep(now=now + HOUR)
        submit(bob, 3600, closes_at=now + 2 * HOUR)
        later = now + HOUR
        assert [run_next(later) for _ in range(5)] == ["alice", "bob", "alice", "bob", "alice"]

    def test_urgency_follows_a_changed_closing_time(self, alice, submit, now):
        submit(alice, closes_at=now + 9 * HOUR)
        reschedule(evaluations=Evaluation.objects.all(), closes_at=now + 5 * HOUR)
        assert Evaluation.objects.get().urgent_from == now + 4 * HOUR

    def test_repeated_runs_and_house_cars_are_never_urgent(self, alice, submit, now):
        done = submit(alice, closes_at=now + HOUR)
        (copy,) = queue_copies(evaluations=[done], priority=queue_order.BACKGROUND, now=now)
        EVALUATIONS.sweep(now=now + 3 * HOUR)
        copy.refresh_from_db()
        assert (copy.priority, copy.urgent_from, done.priority) == (queue_order.BACKGROUND, None, URGENT)


class TestLongQueue:
    @pytest.fixture
    def short_front(self, monkeypatch):
        for module in (queue_order, selectors):
            monkeypatch.setattr(module, "FRONT", 3)

    def test_a_place_is_exact_only_near_the_front(self, alice, submit, short_front):
        waiting = [submit(alice, second) for second in range(6)]
        assert [selectors.queue_position(one) for one in waiting] == [1, 2, 3, 4, 4, 4]
        assert selectors.queue_length() == 4

    def test_a_stopped_run_far_behind_has_no_place(self, alice, submit, short_front, now):
        *_, last = [submit(alice, second) for second in range(6)]
        Evaluation.objects.filter(pk=last.pk).update(state=State.STOPPED, ended_at=now)
        assert selectors.queue_position(last) is None

    def test_pages_show_the_place_in_words(self):
        assert [in_queue(number) for number in (None, 1, 1000, 1001)] == [
            *("", "In queue: next.", "In queue: number 1000.", "In queue: after the first 1,000.")
        ]
        assert [place(number) for number in (None, 1, 7, 1001)] == ["…", "next", "7", "> 1,000"]
        assert (done_in(7.2, 3), done_in(7.2, 1001), done_in(None, 3)) == (
            *("Done in about 8 s.", "Starts in 8 s or later.", ""),
        )
