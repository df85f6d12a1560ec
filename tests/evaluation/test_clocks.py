"""Leases and sweeps go by the database's clock, whatever time a worker's machine believes it is."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import timezone

from core.database.clock import database_now
from evaluation import tasks
from evaluation.models import Evaluation, State
from evaluation.running import pipeline
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.queue.worker import run_next_evaluation
from paddock.rules.race import RaceRules
from tests.drawn_runs import a_driven_run
from tests.factories import a_race
from tests.rows import model_row
from tests.training.jobs import a_training
from tests.wakeups import heard
from training import tasks as training_tasks
from training.jobs.services.queue import TRAININGS
from videos import tasks as video_tasks
from videos.services import VIDEOS, request_video

pytestmark = pytest.mark.django_db(transaction=True)
REAL = timezone.now


@pytest.fixture
def clock_ahead(monkeypatch):
    """Put this machine's clock ahead of the database's."""

    def ahead(**by):
        monkeypatch.setattr(timezone, "now", lambda: REAL() + timedelta(**by))

    return ahead


@pytest.fixture
def queued(alice, oval, wakes):
    return queue_evaluation(owner=alice, model=model_row(alice), track=oval, rules=RaceRules(), now=REAL())


def test_the_time_is_the_databases(db, clock_ahead):
    clock_ahead(hours=2)
    assert abs(database_now() - REAL()) < timedelta(seconds=5)
    assert database_now().utcoffset() == timedelta(0)


def test_work_of_a_dead_worker_two_hours_ahead_is_soon_requeued(queued, clock_ahead, monkeypatch):
    class Dies(BaseException):
        pass

    def dies(*args, **kwargs):
        raise Dies

    clock_ahead(hours=2)
    monkeypatch.setattr(pipeline, "evaluate", dies)
    with pytest.raises(Dies):
        run_next_evaluation(worker="ahead")
    held = Evaluation.objects.get()
    assert held.state == State.RUNNING
    assert held.leased_until < REAL() + timedelta(minutes=1)
    assert EVALUATIONS.sweep(now=REAL() + timedelta(minutes=1)).requeued == 1


@pytest.mark.parametrize("kind", ["evaluation", "training", "video"])
def test_a_worker_31_s_ahead_takes_no_live_lease(
    kind, alice, oval, wakes, video_wakes, monkeypatch, clock_ahead, settings
):
    heard(monkeypatch, "training.tasks.train")
    settings.TRAINING = settings.VIDEOS = True
    now = REAL()
    if kind == "evaluation":
        queue_evaluation(owner=alice, model=model_row(alice), track=oval, rules=RaceRules(), now=now)
        job, sweep = EVALUATIONS.claim(worker="steady", now=database_now()), tasks.sweep
    elif kind == "training":
        a_training(alice, oval, now)
        job, sweep = TRAININGS.claim(worker="steady", now=database_now()), training_tasks.sweep
    else:
        request_video(evaluation=a_driven_run(a_race(now), alice, now), by=alice, language="en", now=now)
        job, sweep = VIDEOS.claim(worker="steady", now=database_now()), video_tasks.sweep
    clock_ahead(seconds=31)
    sweep.apply().get()
    held = type(job).objects.get(pk=job.pk)
    assert (held.state, held.lease) == (job.state, job.lease)
    type(job).objects.update(leased_until=REAL() - timedelta(seconds=1))
    sweep.apply().get()
    held.refresh_from_db()
    assert held.lease is None, "and one that has run out is taken"
