"""Every change of state that may happen happens; every other changes nothing."""

from __future__ import annotations

import uuid
from datetime import timedelta

import pytest

from evaluation.models import Evaluation, Result, State
from evaluation.running.queue.jobs import EVALUATIONS, finish_evaluation
from evaluation.running.queue.services import queue_evaluation, stop_evaluation
from paddock.errors import PlatformFault, UserFault
from paddock.rules.race import RaceRules
from tests.evaluation.stubs import outcome_of
from tests.rows import model_row

FINISHED, FAILED, STOPPED, QUEUED, RUNNING = (
    State.FINISHED,
    State.FAILED,
    State.STOPPED,
    State.QUEUED,
    State.RUNNING,
)


def claim(evaluation, now):
    claimed = EVALUATIONS.claim(worker="w", now=now)
    return claimed is not None and claimed.pk == evaluation.pk


def finish(evaluation, now):
    return finish_evaluation(pk=evaluation.pk, lease=key(evaluation), outcome=outcome_of(), now=now)


def fail_by_user(evaluation, now):
    fault = UserFault("policy_died", step=1, how="exit status 1")
    return EVALUATIONS.fail(pk=evaluation.pk, lease=key(evaluation), fault=fault, now=now)


def fail_by_platform(evaluation, now):
    fault = PlatformFault("storage_failed")
    return EVALUATIONS.fail(pk=evaluation.pk, lease=key(evaluation), fault=fault, now=now)


def kill_at_last(evaluation, now):
    Evaluation.objects.filter(pk=evaluation.pk).update(attempt=9, kills=4)
    another_car_passes(evaluation, now)
    fault = PlatformFault("runner_died", how="signal 11")
    return EVALUATIONS.fail(pk=evaluation.pk, lease=key(evaluation), fault=fault, now=now)


def beat(evaluation, now):
    return EVALUATIONS.beat(pk=evaluation.pk, lease=key(evaluation), progress={"lap": 1}, now=now)


def release(evaluation, now):
    return EVALUATIONS.release(pk=evaluation.pk, lease=key(evaluation), now=now)


def stop(evaluation, now):
    return stop_evaluation(evaluation=evaluation, now=now)


def sweep_in_time(evaluation, now):
    return bool(EVALUATIONS.sweep(now=now + timedelta(seconds=29)).requeued)


def sweep_too_late(evaluation, now):
    return bool(EVALUATIONS.sweep(now=now + timedelta(seconds=31)).requeued)


def sweep_at_last(evaluation, now):
    Evaluation.objects.filter(pk=evaluation.pk).update(attempt=9, kills=4)
    another_car_passes(evaluation, now)
    return bool(EVALUATIONS.sweep(now=now + timedelta(seconds=31)).requeued)


def another_car_passes(evaluation, now):
    model = model_row(evaluation.owner, name="Other", onnx=b"another network")
    queue_evaluation(
        owner=evaluation.owner, model=model, track=evaluation.track, rules=RaceRules(), priority=9, now=now
    )
    assert finish(EVALUATIONS.claim(worker="w", now=now), now)


# what each event makes of a queued and of a running evaluation; None: nothing. A final state never changes.
TABLE = {
    claim: (RUNNING, None),
    beat: (None, RUNNING),
    finish: (None, FINISHED),
    fail_by_user: (None, FAILED),
    fail_by_platform: (None, QUEUED),
    kill_at_last: (None, FAILED),
    release: (None, QUEUED),
    stop: (STOPPED, STOPPED),
    sweep_in_time: (None, None),
    sweep_too_late: (None, QUEUED),
    sweep_at_last: (None, QUEUED),
}
CASES = [
    (event, before, after)
    for event, (of_queued, of_running) in TABLE.items()
    for before, after in [
        (QUEUED, of_queued),
        (RUNNING, of_running),
        (FINISHED, None),
        (FAILED, None),
        (STOPPED, None),
    ]
]


def key(evaluation):
    return evaluation.lease or uuid.uuid4()


def put_in(state, owner, track, now):
    evaluation = queue_evaluation(owner=owner, model=model_row(owner), track=track, rules=RaceRules(), now=now)
    if state == QUEUED:
        return evaluation
    evaluation = EVALUATIONS.claim(worker="w", now=now)
    if state in (FINISHED, FAILED, STOPPED):
        {FINISHED: finish, FAILED: fail_by_user, STOPPED: stop}[state](evaluation, now)
    return evaluation  # with the lease it had while it ran, as a late worker has it


@pytest.mark.parametrize(
    ("event", "before", "after"), CASES, ids=[f"{event.__name__}-{before}" for event, before, _ in CASES]
)
def test_every_event_moves_each_state_as_the_table_says(event, before, after, alice, oval, now, wakes):
    evaluation = put_in(before, alice, oval, now)
    stored = Evaluation.objects.get(pk=evaluation.pk)
    assert stored.state == before
    results = Result.objects.count()
    happened = event(evaluation, now + timedelta(milliseconds=1))
    changed = Evaluation.objects.get(pk=evaluation.pk)
    assert happened == (after is not None)
    assert changed.state == (after or before)
    assert (changed.lease is not None) == (changed.state == RUNNING)
    assert (changed.ended_at is not None) == (changed.state in (FINISHED, FAILED, STOPPED))
    others = event in (kill_at_last, sweep_at_last)
    assert Result.objects.count() == results + (after == FINISHED) + others
    if after is None:
        untouched = {"attempt", "kills"} if others else set()
        for field in Evaluation._meta.concrete_fields:
            if field.name not in untouched:
                assert getattr(changed, field.name) == getattr(stored, field.name), field.name
