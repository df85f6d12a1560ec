"""The race that a training submits its model to when it is done."""

from __future__ import annotations

import os
import signal
from datetime import datetime, timedelta

import pytest
from django.db import connections
from django.utils import timezone

from evaluation.models import TrainedModel
from paddock.errors import UserFault
from races.models import Race, Submission
from tests.factories import a_race
from tests.training.jobs import a_training, network
from training.jobs.services import results
from training.jobs.services.queue import TRAININGS
from training.jobs.services.worker import run_next_training
from training.models import JobState
from training.trainer.client import Ended

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.usefixtures("training_wakes", "wakes")]


@pytest.fixture
def now() -> datetime:
    """A worker reads the real clock, and finds the race open by it."""
    return timezone.now()


@pytest.fixture
def race(oval, now) -> Race:
    return a_race(now, track=oval)


@pytest.fixture
def job(alice, oval, now, race, trainer):
    job = a_training(alice, oval, now, submit_to_race=race)
    trainer.networks = [network(job, 1)] * 2
    return job


def run_in_a_worker_that_dies() -> int:
    """Run the training in a process of its own; the signal that ended that."""
    connections.close_all()  # nothing of this process is used in the other
    child = os.fork()
    if not child:
        try:
            run_next_training(worker="to be killed")
        finally:
            os._exit(0)
    return -os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("written", [False, True], ids=["before it is submitted", "after it is submitted"])
def test_a_kill_between_end_and_submission_loses_neither(job, race, now, monkeypatch, written):
    submit_model = results.submit_model

    def killed(**asked):
        if written:
            submit_model(**asked)
        os.kill(os.getpid(), signal.SIGKILL)

    with monkeypatch.context() as dying:
        dying.setattr(results, "submit_model", killed)
        assert run_in_a_worker_that_dies() == signal.SIGKILL

    job.refresh_from_db()
    TRAININGS.sweep(now=(job.leased_until or now) + timedelta(seconds=1))
    run_next_training(worker="the next one")
    job.refresh_from_db()
    assert (job.state, job.submit_reason_code) == (JobState.FINISHED, "")
    assert [sent.training_job for sent in Submission.objects.filter(entry__race=race)] == [job]
    assert TrainedModel.objects.get() == job.best_model == job.submission.evaluation.model


def test_a_refusal_by_the_race_is_shown_with_the_training(alice, oval, now, trainer):
    race = a_race(now, track=oval)
    job = a_training(alice, oval, now, submit_to_race=race)
    Race.objects.filter(pk=race.pk).update(sensors=["STEREO_CAMERAS"])  # its organiser thought again
    trainer.networks = [network(job, 1)] * 2
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.submission) == (JobState.FINISHED, None)
    assert job.submit_reason_code and job.submit_reason
    assert job.best_model == job.last_model, "one network is one model"


def test_what_the_race_notes_of_a_refusal_stays(alice, bob, oval, now, trainer, monkeypatch):
    def noted(**asked):
        Race.objects.filter(pk=asked["race"].pk).update(description="noted")
        raise UserFault("car_of_another", racer=bob.alias)

    monkeypatch.setattr("training.jobs.services.results.submit_model", noted)
    job = a_training(alice, oval, now, submit_to_race=a_race(now, track=oval))
    trainer.networks = [network(job, 1)] * 2
    run_next_training(worker="w")
    job.refresh_from_db()
    assert job.submit_reason_code == "car_of_another" and Race.objects.get().description == "noted"


def test_a_submission_failing_through_us_keeps_the_model(alice, oval, now, trainer, monkeypatch):
    def broken(**_):
        raise RuntimeError("the disk is full")

    monkeypatch.setattr("training.jobs.services.results.submit_model", broken)
    job = a_training(alice, oval, now, submit_to_race=a_race(now, track=oval))
    trainer.networks = [network(job, 1)] * 2
    run_next_training(worker="w")
    job.refresh_from_db()
    assert (job.state, job.submit_reason_code) == (JobState.FINISHED, "submit_failed")
    assert job.best_model is not None


@pytest.mark.parametrize("fails", [False, True], ids=["that finishes", "that fails"])
def test_a_race_deleted_during_a_training_keeps_the_model(alice, oval, now, trainer, fails):
    job = a_training(alice, oval, now, submit_to_race=a_race(now, track=oval))
    trainer.networks = [network(job, 1)] * 2

    def end() -> Ended:
        Race.objects.all().delete()
        if fails:
            raise UserFault("training_diverged")
        return Ended("time", 200, 2.0, b"zip")

    trainer.at_the_end = end
    run_next_training(worker="w")
    job.refresh_from_db()
    ended = (JobState.FAILED, "") if fails else (JobState.FINISHED, "submit_failed")
    assert (job.state, job.submit_reason_code) == ended
    assert job.best_model is not None
