"""A race has one engine: when the site's is another one, its runs are driven again and count together."""

from __future__ import annotations

import pytest
from django.db import IntegrityError, transaction

from evaluation.models import Evaluation, State
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.order import BACKGROUND
from evaluation.running.queue.selectors import queue_length
from races.boards.selectors.counts import DrivenAgain, driven_again
from races.entries.selectors.visibility import can_see_evaluation, evaluations_visible_to
from races.entries.services.entries import enter_race, withdraw
from races.entries.services.redrives import drive_again, sweep_redrives
from races.entries.services.standings import recompute_race
from races.entries.services.submissions import submit_model
from races.models import Entry, Redrive, RedriveState, Retiming, Submission
from tests.factories import a_model, a_race, a_racer, drive, finish, laps, start
from tests.redrives import end, everything, pending, shown

from .site import MINUTE, NEW, OLD, again, fresh

pytestmark = pytest.mark.django_db


class TestEngineOfARace:
    def test_the_first_result_sets_the_engine_of_a_race(self, cast, site, now):
        race = a_race(now)
        submission = submit_model(race=race, racer=cast[0], model=a_model(cast[0]), now=now)
        assert fresh(race).engine == ""
        site(NEW)
        assert sweep_redrives(now=now) == 0
        finish(submission, laps(9_000, 9_000, 9_000), now)
        assert (fresh(race).engine, fresh(race).next_engine) == (NEW, "")
        assert shown(race) == [("ann", 9_000)]

    def test_nothing_happens_while_the_engine_is_the_same(self, race, now):
        before = everything(race)
        assert sweep_redrives(now=now) == drive_again(race=race, now=now) == 0
        assert everything(race) == before and not Redrive.objects.exists()


class TestRedrive:
    def test_each_counted_run_is_queued_once_with_its_frozen_rules(self, upgraded, now):
        race = upgraded
        assert sweep_redrives(now=now) == drive_again(race=race, now=now) == 0
        for one in pending(race):
            old, new = one.submission.evaluation, one.evaluation
            for name in ("spec", "model_id", "track_id", "owner_id"):
                assert getattr(new, name) == getattr(old, name)
            assert (new.state, new.priority, one.engine) == (State.QUEUED, BACKGROUND, NEW)
        assert Redrive.objects.count() == 3

    def test_a_submission_has_at_most_one_pending_redrive(self, upgraded, now):
        first, second, _third = pending(upgraded)
        with pytest.raises(IntegrityError), transaction.atomic():
            Redrive.objects.filter(pk=second.pk).update(submission=first.submission)

    def test_the_board_changes_only_when_all_redrives_are_done(self, upgraded, now):
        race = upgraded
        before = everything(race)
        first, second, third = pending(race)
        end(third, laps(8_000, 8_000, 8_000), now)
        end(first, laps(10_500, 10_500, 10_500), now)
        assert sweep_redrives(now=now) == 0
        assert everything(race) == [{**before[0], "next_engine": NEW}, *before[1:]]
        assert driven_again(fresh(race)) == DrivenAgain(NEW, done=2, runs=3)
        end(second, laps(11_000, 11_000, 11_000), now)
        sweep_redrives(now=now)
        assert shown(race) == [("cat", 8_000), ("ann", 10_500), ("bob", 11_000)]
        done = fresh(race)
        assert (done.engine, done.next_engine, done.fastest_lap_ms) == (NEW, "", 8_000)
        assert driven_again(done) is None
        assert not Redrive.objects.exclude(state=RedriveState.TAKEN).exists()
        # what was worked out at once is what the runs themselves say
        stands = everything(race)
        recompute_race(race=done)
        assert everything(race) == stands

    def test_the_last_redrive_makes_all_count_without_a_sweep(self, upgraded, now, commits):
        again(upgraded, now, 9_000, 9_100, 9_200)
        assert shown(upgraded) == [("ann", 9_000), ("bob", 9_100), ("cat", 9_200)]

    def test_a_redrive_costs_no_submission_and_keeps_the_old_runs(self, upgraded, now):
        old = set(Submission.objects.values_list("evaluation", flat=True))
        again(upgraded, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        assert list(Entry.objects.values_list("submission_count", "last_number").distinct()) == [(1, 1)]
        assert set(Redrive.objects.values_list("replaced", flat=True)) == old
        assert Evaluation.objects.filter(pk__in=old, result__engine=OLD).count() == 3
        assert Submission.objects.filter(evaluation__result__engine=NEW, is_void=False).count() == 3

    def test_changed_times_are_recorded_with_both_places(self, upgraded, now):
        again(upgraded, now, 12_500, 11_000, 8_000)
        sweep_redrives(now=now)
        rows = Retiming.objects.order_by("entry").values_list(
            "entry__racer__alias", "old_score_ms", "old_rank", "new_score_ms", "new_rank", "old_engine", "new_engine"
        )
        assert list(rows) == [("ann", 10_000, 1, 12_500, 3, OLD, NEW), ("cat", 12_000, 3, 8_000, 1, OLD, NEW)]

    def test_a_redrive_may_change_which_car_is_a_racers_best(self, race, cast, site, now):
        second = drive(race, cast[0], laps(10_200, 10_200, 10_200), now)
        site(NEW)
        assert sweep_redrives(now=now) == 4
        for one in pending(race):
            slow = one.submission != second and one.submission.entry.racer == cast[0]
            end(one, laps(*[10_400 if slow else 10_100] * 3), now)
        sweep_redrives(now=now)
        assert Entry.objects.get(race=race, racer=cast[0]).best == second

    def test_a_redrive_delays_nobody_and_uses_no_turn(self, upgraded, cast, now):
        ann, bob, _ = cast
        assert queue_length() == 0
        mine = submit_model(race=upgraded, racer=ann, model=a_model(ann), now=now + MINUTE)
        other = submit_model(race=upgraded, racer=bob, model=a_model(bob), now=now + 2 * MINUTE)
        start(pending(upgraded)[0].evaluation, now + 3 * MINUTE)
        order = [EVALUATIONS.claim(worker="w", now=now + 4 * MINUTE) for _ in range(3)]
        assert [order[0], order[1]] == [mine.evaluation, other.evaluation]
        assert order[2].priority == BACKGROUND

    def test_only_operators_see_a_redrive_before_it_counts(self, upgraded, cast, now):
        one = pending(upgraded)[0]
        readers = [(None, False), (cast[0], False), (cast[1], False), (a_racer("admin", is_staff=True), True)]
        for reader, sees in readers:
            assert can_see_evaluation(reader, one.evaluation) is sees
            assert evaluations_visible_to(reader).filter(pk=one.evaluation_id).exists() is sees
        again(upgraded, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        for reader, _ in readers:
            assert can_see_evaluation(reader, one.evaluation)
            assert evaluations_visible_to(reader).filter(pk=one.evaluation_id).exists()

    def test_a_withdrawn_racer_is_redriven_too(self, race, cast, site, now):
        withdraw(entry=Entry.objects.get(race=race, racer=cast[0]), now=now)
        site(NEW)
        assert sweep_redrives(now=now) == 3
        again(race, now, 9_000, 9_100, 9_200)
        sweep_redrives(now=now)
        assert shown(race) == [("bob", 9_100), ("cat", 9_200)]
        enter_race(race=fresh(race), racer=cast[0], now=now)
        assert shown(race)[0] == ("ann", 9_000)
        assert fresh(race).fastest_lap_ms == 9_000

    def test_a_deleted_model_with_a_standing_result_is_redriven(self, race, site, now):
        Evaluation.objects.get(owner__alias="ann").model.__class__.objects.update(deleted_at=now)
        site(NEW)
        assert sweep_redrives(now=now) == 3


def test_the_database_refuses_a_retiming_without_a_change(race, now):
    entry = Entry.objects.filter(race=race).first()
    for scores in ({"old_score_ms": 5, "new_score_ms": 5}, {}):
        with pytest.raises(IntegrityError), transaction.atomic():
            Retiming.objects.create(entry=entry, at=now, old_engine=OLD, new_engine=NEW, **scores)
