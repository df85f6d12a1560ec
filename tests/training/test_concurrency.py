"""Two tabs, two workers, an owner and a worker at the same moment: on SQLite here, on PostgreSQL below."""

from __future__ import annotations

from datetime import timedelta

import pytest

from paddock.errors import UserFault
from tests.factories import a_racer
from tests.races.test_concurrency import at_once
from tests.training.jobs import a_training, an_iteration
from training.jobs.services.queue import TRAININGS, stop_training
from training.jobs.services.records import keep_checkpoint, record_iteration
from training.models import Checkpoint, JobState, TrainingIteration, TrainingJob, Vehicle
from training.vehicles.services import save_vehicle

from .test_leases import NETWORKS, saved

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.usefixtures("training_wakes")]
TABS = 6


def codes(answers: list[object], kind: type) -> list[str]:
    """What the others were told."""
    return sorted(str(answer) for answer in answers if not isinstance(answer, kind))


def test_a_training_sent_by_six_tabs_is_made_once(oval, now, settings):
    settings.TRAININGS_AT_ONCE = TABS
    racer = a_racer()
    answers = at_once([lambda: a_training(racer, oval, now)] * TABS)
    assert codes(answers, TrainingJob) == ["training_name_taken"] * (TABS - 1), answers
    assert TrainingJob.objects.count() == 1


def test_many_tabs_cannot_exceed_the_limit_of_trainings(oval, now, settings):
    settings.TRAININGS_AT_ONCE = 2
    racer = a_racer()
    answers = at_once([lambda n=n: a_training(racer, oval, now, name=f"tab-{n}") for n in range(TABS)])
    assert codes(answers, TrainingJob) == ["training_jobs_at_once"] * (TABS - 2), answers
    assert TrainingJob.objects.count() == 2


def test_minutes_of_a_month_are_given_out_once(oval, now, settings):
    settings.TRAININGS_AT_ONCE, settings.TRAINING_MINUTES_A_MONTH = TABS, 25
    racer = a_racer()
    answers = at_once([lambda n=n: a_training(racer, oval, now, name=f"tab-{n}") for n in range(TABS)])
    assert codes(answers, TrainingJob) == ["training_minutes_left"] * (TABS - 2), answers


def test_six_workers_claim_two_trainings_once_each(oval, now):
    for _ in range(2):
        a_training(a_racer(), oval, now)
    answers = at_once([lambda n=n: TRAININGS.claim(worker=f"w{n}", now=now) for n in range(TABS)])
    taken = [answer.pk for answer in answers if isinstance(answer, TrainingJob)]
    assert len(taken) == len(set(taken)) == 2, answers
    assert answers.count(None) == TABS - 2, answers


def test_a_stop_comes_before_the_start_or_after_it_never_both(oval, now):
    for _ in range(4):
        job = a_training(a_racer(), oval, now)
        stopped, claimed = at_once(
            [lambda job=job: stop_training(job=job, now=now), lambda: TRAININGS.claim(worker="w", now=now)]
        )
        job.refresh_from_db()
        assert stopped is True
        if claimed is None:
            assert (job.state, job.ended_at) == (JobState.STOPPED, now)
        else:
            assert (job.state, job.stop_asked_at) == (JobState.RUNNING, now), "its worker hears of it at the next beat"
            TrainingJob.objects.filter(pk=job.pk).delete()


def test_only_one_of_several_simultaneous_ends_is_written(oval, now):
    job = a_training(a_racer(), oval, now)
    held = TRAININGS.claim(worker="w", now=now)
    late = held.leased_until + timedelta(seconds=1)
    fault = UserFault("training_memory", limit_mb=1)
    mine = {"job_id": held.pk, "lease": held.lease, "now": now}
    ended, released, _ = at_once(
        [
            lambda: TRAININGS.fail(**mine, fault=fault),
            lambda: TRAININGS.release(**mine),
            lambda: TRAININGS.sweep(now=late),
        ]
    )
    job.refresh_from_db()
    assert not (ended is True and released is True)
    assert job.state in (JobState.FAILED, JobState.QUEUED) and job.lease is None
    assert (job.state == JobState.FAILED) == (ended is True)


def test_a_worker_without_its_lease_writes_nothing(oval, now):
    a_training(a_racer(), oval, now)
    first = TRAININGS.claim(worker="first", now=now)
    TRAININGS.sweep(now=first.leased_until + timedelta(seconds=1))
    second = TRAININGS.claim(worker="second", now=now)

    def write(job, worker):
        return [
            record_iteration(job=job, lease=job.lease, iteration=an_iteration(number, eval_reward=worker), now=now)
            and keep_checkpoint(job=job, lease=job.lease, saved=saved(number), networks=NETWORKS, now=now)
            for number in (1, 2, 3)
        ]

    answers = at_once([lambda: write(first, 1.0), lambda: write(second, 2.0)])
    assert answers == [[False] * 3, [True] * 3]
    assert set(TrainingIteration.objects.values_list("number", "eval_reward")) == {(1, 2.0), (2, 2.0), (3, 2.0)}
    assert Checkpoint.objects.count() == 2


def test_only_one_of_six_tabs_saves_the_vehicle(now):
    racer = a_racer()
    answers = at_once([lambda: save_vehicle(owner=racer, name="Owl")] * TABS)
    assert codes(answers, Vehicle) == ["vehicle_name_taken"] * (TABS - 1), answers


@pytest.mark.postgres
@pytest.mark.soak
@pytest.mark.django_db(transaction=False)
def test_these_tests_pass_on_postgresql_too(again_on_postgresql):
    again_on_postgresql(*(f"tests/training/test_{name}.py" for name in ("concurrency", "leases", "create", "removal")))
