"""Why a training ended: a code that never changes, and a sentence for whoever reads it."""

from __future__ import annotations

import pytest
from django.db import IntegrityError, transaction
from django.utils import translation

from core.events import Event
from paddock.errors import UserFault
from tests.training.jobs import a_training
from training.jobs.selectors import how_it_ended
from training.jobs.services.queue import TRAININGS, stop_training
from training.models import EndReason, JobState, TrainingJob

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("training_wakes")]


def ended(job: TrainingJob, why: str, **more) -> TrainingJob:
    """The training as it stands when it has ended for this reason."""
    states = {EndReason.STOPPED: JobState.STOPPED, EndReason.FAILED: JobState.FAILED}
    values = {"state": states.get(why, JobState.FINISHED), "ended_because": why, "ended_at": job.created_at}
    TrainingJob.objects.filter(pk=job.pk).update(steps_done=5000, started_at=job.created_at, **values, **more)
    job.refresh_from_db()
    return job


@pytest.mark.parametrize(
    ("why", "asked", "says", "in_korean"),
    [
        (EndReason.TIME, {"stop_minutes": 5}, "Time limit reached (5 minutes)", "5분"),
        (EndReason.STEPS, {"stop_steps": 5000}, "Step limit reached (5,000)", "5,000"),
        (EndReason.CLEAN_LAPS, {"stop_clean_laps": 3}, "Goal reached: 3 clean laps in a row", "랩 3개"),
        (EndReason.CLEAN_LAPS, {"stop_clean_laps": 1}, "Goal reached: 1 clean lap", "랩 1개"),
    ],
)
def test_a_stop_condition_is_told_with_its_number(alice, oval, now, why, asked, says, in_korean):
    job = ended(a_training(alice, oval, now, **asked), why)
    assert how_it_ended(job, alice) == says
    with translation.override("ko"):
        assert in_korean in how_it_ended(job, alice)


def test_an_unfinished_training_has_no_ending(alice, oval, now):
    job = a_training(alice, oval, now)
    assert how_it_ended(job, alice) == ""
    assert how_it_ended(TRAININGS.claim(worker="w", now=now), alice) == ""


def test_the_ending_says_who_stopped_it(alice, bob, oval, now):
    job = a_training(alice, oval, now)
    stop_training(job=job, by=alice, now=now)
    assert how_it_ended(job, alice) == "Stopped by you before it started"
    assert how_it_ended(job, bob) == "Stopped by its owner before it started"
    event = Event.objects.get(kind="training.ended")
    assert (event.racer, event.subject, event.data) == (
        alice,
        job.public_id,
        {"ended_because": "stopped", "reason": ""},
    )
    job = ended(a_training(alice, oval, now, name="second"), EndReason.STOPPED, stopped_by=bob)
    assert how_it_ended(job, alice) == "Stopped by an admin"
    assert how_it_ended(ended(job, EndReason.STOPPED, stopped_by=None), alice) == "Stopped by you"


def test_a_failure_is_told_with_its_reason_and_line(alice, oval, now):
    a_training(alice, oval, now)
    job = TRAININGS.claim(worker="w", now=now)
    fault = UserFault("reward_raised", line=2, error="ZeroDivisionError")
    TRAININGS.fail(pk=job.pk, lease=job.lease, fault=fault, now=now)
    job.refresh_from_db()
    assert job.ended_because == EndReason.FAILED
    assert how_it_ended(job, alice) == "Line 2 of the reward function failed: ZeroDivisionError."


@pytest.mark.parametrize(
    ("state", "why"),
    [("finished", ""), ("finished", "stopped"), ("stopped", "time"), ("stopped", ""), ("failed", "time")],
)
def test_every_ending_has_a_reason(alice, oval, now, state, why):
    job = a_training(alice, oval, now)
    values = {"state": state, "ended_because": why, "ended_at": now, "steps_done": 1, "reason_code": "reward_stuck"}
    with pytest.raises(IntegrityError, match="training_end_has_reason"), transaction.atomic():
        TrainingJob.objects.filter(pk=job.pk).update(**values)
    with pytest.raises(IntegrityError, match="training_end_has_reason"), transaction.atomic():
        TrainingJob.objects.filter(pk=job.pk).update(ended_because=why or "time")


def test_the_end_and_the_slow_reward_function_are_two_sentences(alice, oval, now):
    job = ended(a_training(alice, oval, now), EndReason.STOPPED, stopped_by=alice)
    job.reward_ms = 86.0
    assert how_it_ended(job, alice).startswith("Stopped by you. Each call of the reward function took 86 ms")
