"""Trainings take turns by racer, and what they cost is counted by the database's clock from the claim to the end."""

from __future__ import annotations

from datetime import timedelta

import pytest

from paddock.errors import PlatformFault, UserFault
from tests.training.jobs import a_training
from training.jobs.queue_order import place_of, waiting_in_order
from training.jobs.selectors import minutes_used
from training.jobs.services.queue import TRAININGS, stop_training
from training.jobs.services.records import keep_checkpoint
from training.jobs.services.results import finish_training
from training.models import JobState, TrainingJob
from training.trainer.client import Ended

from .test_leases import NETWORKS, saved

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("training_wakes")]
MINUTE = timedelta(minutes=1)


def order(now) -> list[str]:
    names = dict(TrainingJob.objects.values_list("pk", "name"))
    return [names[waiting.pk] for waiting in waiting_in_order(now)]


def has_had(racer, track, at, minutes: float, name: str = "had") -> TrainingJob:
    """A training of this racer that ended at ``at`` and held a trainer for so long."""
    job = a_training(racer, track, at, name=name)
    TrainingJob.objects.filter(pk=job.pk).update(
        state=JobState.STOPPED, ended_because="stopped", ended_at=at, charged_s=60 * minutes
    )
    return job


class TestQueueOrder:
    def test_the_racer_who_trained_least_comes_first(self, alice, bob, charlie, oval, now):
        has_had(alice, oval, now, 30)
        has_had(bob, oval, now, 5)
        for place, (racer, name) in enumerate([(alice, "a"), (bob, "b"), (charlie, "c")]):
            a_training(racer, oval, now + timedelta(seconds=place), name=name)
        assert order(now) == ["c", "b", "a"]
        assert TRAININGS.claim(worker="w", now=now).name == "c"

    def test_nobody_waits_behind_all_of_another_racers_trainings(self, alice, bob, oval, now, settings):
        settings.TRAININGS_AT_ONCE = 3
        for number in range(3):
            a_training(alice, oval, now + timedelta(seconds=number), name=f"a{number}")
        last = a_training(bob, oval, now + timedelta(seconds=9), name="b")
        assert order(now) == ["a0", "b", "a1", "a2"]
        assert place_of(last, now) == 2

    def test_running_trainings_count(self, alice, bob, oval, now, settings):
        a_training(alice, oval, now, name="running")
        TRAININGS.claim(worker="w", now=now)
        a_training(alice, oval, now, name="a")
        a_training(bob, oval, now + MINUTE, name="b")
        assert order(now + 2 * MINUTE) == ["b", "a"]

    def test_trainings_of_a_day_ago_do_not_count(self, alice, bob, oval, now):
        has_had(alice, oval, now - timedelta(days=1), 600)
        a_training(alice, oval, now, name="a")
        a_training(bob, oval, now + MINUTE, name="b")
        assert order(now + 2 * MINUTE) == ["a", "b"]

    def test_a_pausing_training_is_passed_over(self, alice, bob, oval, now):
        paused = a_training(alice, oval, now, name="a")
        TrainingJob.objects.filter(pk=paused.pk).update(not_before=now + MINUTE)
        a_training(bob, oval, now, name="b")
        paused.refresh_from_db()
        assert (order(now), place_of(paused, now)) == (["b"], 2)
        assert order(now + MINUTE) == ["a", "b"]

    def test_an_ended_training_awaiting_its_models_comes_first(self, alice, bob, oval, now):
        has_had(alice, oval, now, 600)
        kept = a_training(alice, oval, now + MINUTE, name="a")
        TrainingJob.objects.filter(pk=kept.pk).update(reason_code="reward_raised")
        a_training(bob, oval, now, name="b")
        assert order(now + MINUTE) == ["a", "b"]

    def test_a_longer_queue_takes_no_more_queries(self, alice, bob, oval, now, django_assert_num_queries):
        for racer in (alice, bob):
            for name in ("one", "two"):
                a_training(racer, oval, now, name=name)
            with django_assert_num_queries(2):
                waiting_in_order(now)


class TestCharge:
    @pytest.fixture
    def held(self, alice, oval, now) -> TrainingJob:
        a_training(alice, oval, now)
        return TRAININGS.claim(worker="w", now=now)

    def ends(self, held, fault, at) -> TrainingJob:
        assert TRAININGS.fail(pk=held.pk, lease=held.lease, fault=fault, now=at)
        held.refresh_from_db()
        return held

    def test_the_time_from_claim_to_end_is_charged(self, held, now):
        job = self.ends(held, UserFault("reward_stuck", how="nothing was heard"), now + 11 * MINUTE)
        assert (job.charged_s, job.seconds_done) == (660.0, 0.0)
        assert minutes_used(job.owner, now) == 11.0

    def test_a_good_end_is_charged_the_same(self, held, alice, now):
        from tests.factories import a_model

        models = (a_model(alice),) * 2
        ended = Ended("time", 100, 2.0, b"")
        assert finish_training(job=held, lease=held.lease, ended=ended, models=models, now=now + MINUTE)
        held.refresh_from_db()
        assert (held.charged_s, held.seconds_done) == (60.0, 2.0)

    def test_every_attempt_ended_by_its_own_process_is_charged(self, held, now):
        self.ends(held, PlatformFault("trainer_error", detail="x"), now + MINUTE)
        again = TRAININGS.claim(worker="w", now=now + 5 * MINUTE)
        assert self.ends(again, PlatformFault("trainer_error", detail="x"), now + 7 * MINUTE).charged_s == 180.0

    @pytest.mark.parametrize("how", ["trainer_died", "trainer_lost", "released"])
    def test_an_attempt_ended_from_outside_costs_what_was_kept(self, held, now, how):
        keep_checkpoint(job=held, lease=held.lease, saved=saved(40), networks=NETWORKS, now=now)
        at = held.leased_until + 10 * MINUTE
        if how == "released":
            assert TRAININGS.release(pk=held.pk, lease=held.lease, now=at)
        elif how == "trainer_lost":
            TRAININGS.sweep(now=at)
        else:
            self.ends(held, PlatformFault("trainer_died", how="signal 9"), at)
        held.refresh_from_db()
        assert (held.state, held.charged_s) == (JobState.QUEUED, 40.0)
        again = TRAININGS.claim(worker="w", now=at)
        assert self.ends(again, UserFault("training_diverged"), at + MINUTE).charged_s == 100.0

    def test_an_attempt_that_kept_nothing_costs_nothing(self, held, now):
        assert self.ends(held, PlatformFault("trainer_died", how="signal 9"), now + MINUTE).charged_s == 0.0

    def test_a_training_under_way_reserves_its_time_limit(self, held, now):
        assert minutes_used(held.owner, now) == held.stop_minutes
        TrainingJob.objects.filter(pk=held.pk).update(charged_s=6000.0)
        assert minutes_used(held.owner, now) == 100.0


def test_stopping_a_training_ends_its_pause(alice, oval, now):
    a_training(alice, oval, now)
    job = TRAININGS.claim(worker="w", now=now)
    keep_checkpoint(job=job, lease=job.lease, saved=saved(1), networks=NETWORKS, now=now)
    TrainingJob.objects.filter(pk=job.pk).update(failures=6, got_to=1)
    job.refresh_from_db()
    TRAININGS.fail(pk=job.pk, lease=job.lease, fault=PlatformFault("trainer_died", how="signal 9"), now=now)
    assert TRAININGS.claim(worker="w", now=now + MINUTE) is None
    stop_training(job=job, now=now)
    assert TRAININGS.claim(worker="w", now=now + MINUTE) == job
