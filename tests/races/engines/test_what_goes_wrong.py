"""Runs that fail, a second change of the engine, and kills in between."""

from __future__ import annotations

from datetime import timedelta

import pytest

from core.jobs.retried import pause_after
from evaluation.models import Evaluation
from evaluation.running.queue.services import stop_evaluation
from evaluation.running.worker_nodes import start_worker
from races.boards.selectors.counts import DrivenAgain, driven_again
from races.entries.services import redrives
from races.entries.services.redrives import sweep_redrives
from races.entries.services.submissions import submit_model
from races.models import Redrive, RedriveState, Retiming, Submission
from tests.factories import a_model, a_race, drive, fail, laps, start
from tests.redrives import break_down, end, everything, pending, shown

from .site import NEW, NEWEST, OLD, OURS, THEIRS, again, fresh

pytestmark = pytest.mark.django_db


class TestFailedRuns:
    def test_a_run_the_car_fails_voids_and_refunds_its_submission(self, upgraded, cast, now):
        first, second, third = pending(upgraded)
        break_down(first, THEIRS, now)
        end(second, laps(11_000, 11_000, 11_000), now)
        end(third, laps(12_000, 12_000, 12_000), now)
        sweep_redrives(now=now)
        assert shown(upgraded) == [("bob", 11_000), ("cat", 12_000), ("ann", None)]
        submission = Submission.objects.get(entry__racer=cast[0])
        assert (submission.is_void, submission.refunded, submission.evaluation) == (True, True, first.evaluation)
        assert submission.entry.submission_count == 0
        told = Retiming.objects.get()
        assert (told.old_score_ms, told.new_score_ms, told.reason_code) == (10_000, None, "policy_died")

    def test_a_run_the_platform_fails_is_retried_after_growing_pauses(self, upgraded, now):
        before = shown(upgraded)
        first, second, third = pending(upgraded)
        end(second, laps(9_100, 9_100, 9_100), now)
        end(third, laps(9_200, 9_200, 9_200), now)
        at = now
        for pause in (pause_after(attempt) for attempt in range(2, 7)):
            (waiting,) = [one for one in pending(upgraded) if one.submission == first.submission]
            break_down(waiting, OURS, at)
            assert sweep_redrives(now=at + pause - timedelta(seconds=1)) == 0
            at += pause
            assert sweep_redrives(now=at) == 1
            assert driven_again(fresh(upgraded)) == DrivenAgain(NEW, done=2, runs=3)
        assert shown(upgraded) == before
        (waiting,) = [one for one in pending(upgraded) if one.submission == first.submission]
        assert waiting.tries == 6
        end(waiting, laps(9_000, 9_000, 9_000), at)
        sweep_redrives(now=at)
        assert shown(upgraded)[0] == ("ann", 9_000)

    def test_an_operator_can_stop_one_redrive_and_let_the_race_go_on(self, upgraded, now):
        first, second, third = pending(upgraded)
        stop_evaluation(evaluation=first.evaluation, now=now)
        end(second, laps(9_100, 9_100, 9_100), now)
        end(third, laps(9_200, 9_200, 9_200), now)
        sweep_redrives(now=now)
        assert shown(upgraded) == [("bob", 9_100), ("cat", 9_200), ("ann", None)]

    def test_a_car_that_failed_under_the_old_engine_stays_failed(self, race, cast, site, now):
        failed = submit_model(race=race, racer=cast[0], model=a_model(cast[0]), now=now)
        fail(failed, THEIRS, now)
        site(NEW)
        assert sweep_redrives(now=now) == 3


class TestSecondEngineChange:
    def test_a_second_change_starts_over(self, upgraded, site, now, commits):
        race, before = upgraded, shown(upgraded)
        first, second, _third = pending(race)
        end(first, laps(9_000, 9_000, 9_000), now)
        start(second.evaluation, now)
        site(NEWEST)
        assert sweep_redrives(now=now) == 3
        assert shown(race) == before
        assert Redrive.objects.filter(engine=NEW, state=RedriveState.DROPPED).count() == 3
        assert set(Evaluation.objects.filter(redrive__engine=NEW).values_list("state", flat=True)) == {
            "finished",
            "stopped",
        }
        again(race, now, 8_000, 8_100, 8_200)
        assert (shown(race)[0], fresh(race).engine) == (("ann", 8_000), NEWEST)
        assert set(Retiming.objects.values_list("old_engine", "new_engine")) == {(OLD, NEWEST)}

    def test_going_back_keeps_the_board_and_redrives_newer_cars(self, upgraded, cast, site, now):
        race = upgraded
        drive(race, cast[2], laps(7_000, 7_000, 7_000), now)
        site(OLD)
        assert sweep_redrives(now=now) == 1
        assert [one.submission.entry.racer for one in pending(race)] == [cast[2]]
        again(race, now, 9_500)
        sweep_redrives(now=now)
        assert shown(race) == [("cat", 9_500), ("ann", 10_000), ("bob", 11_000)]
        assert (fresh(race).engine, fresh(race).next_engine) == (OLD, "")

    def test_going_back_with_no_newer_cars_drops_every_redrive(self, upgraded, site, now, commits):
        before = shown(upgraded)
        site(OLD)
        assert sweep_redrives(now=now) == 0
        assert (shown(upgraded), fresh(upgraded).next_engine, pending(upgraded)) == (before, "", [])

    def test_a_result_from_an_old_worker_is_dropped(self, upgraded, site, now):
        one = pending(upgraded)[0]
        site(OLD)
        end(one, laps(9_000, 9_000, 9_000), now)
        site(NEW)
        assert sweep_redrives(now=now) == 1
        assert Redrive.objects.get(pk=one.pk).state == RedriveState.DROPPED

    def test_no_redrive_starts_while_a_live_worker_has_another_engine(self, race, site, now):
        start_worker(name="old", queues=["celery"], processes=1, now=now)
        start_worker(name="videos", queues=["videos"], processes=1, now=now)
        site(NEW)
        assert sweep_redrives(now=now + timedelta(seconds=30)) == 0
        assert fresh(race).next_engine == "" and not Redrive.objects.exists()
        start_worker(name="old", queues=["celery"], processes=1, now=now)
        assert sweep_redrives(now=now + timedelta(seconds=30)) == 3


class TestInterruptions:
    @pytest.mark.parametrize("step", ["work_out_standings", "_standings"])
    def test_an_interrupted_switch_is_done_by_the_next_sweep(self, upgraded, monkeypatch, now, step):
        again(upgraded, now, 9_000, 9_100, 9_200)
        before = everything(upgraded)
        with monkeypatch.context() as killed:
            killed.setattr(redrives, step, lambda *args: 1 / 0)
            sweep_redrives(now=now)
        assert everything(upgraded) == before and not Retiming.objects.exists()
        assert Redrive.objects.filter(state=RedriveState.PENDING).count() == 3
        sweep_redrives(now=now)
        assert shown(upgraded)[0] == ("ann", 9_000)
        sweep_redrives(now=now)
        assert Retiming.objects.count() == 3

    def test_interrupted_queueing_leaves_nothing_queued(self, race, site, monkeypatch, now):
        site(NEW)
        with monkeypatch.context() as killed:
            killed.setattr(redrives.Redrive.objects, "bulk_create", lambda *args, **options: 1 / 0)
            assert sweep_redrives(now=now) == 0
        assert fresh(race).next_engine == "" and Evaluation.objects.count() == 3
        assert sweep_redrives(now=now) == 3

    def test_a_failing_race_does_not_delay_the_others(self, race, cast, site, monkeypatch, now):
        other = a_race(now, closes_at=now + timedelta(days=8))
        drive(other, cast[0], laps(9_000, 9_000, 9_000), now)
        site(NEW)
        real = redrives.hold_above
        monkeypatch.setattr(redrives, "hold_above", lambda one: 1 / 0 if one == race else real(one))
        assert sweep_redrives(now=now) == 1
