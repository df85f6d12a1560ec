"""Workers that an operator has paused or drained claim no job of any kind."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import IntegrityError, transaction

from core.jobs.holds import hold_of, hold_workers, resume_workers
from core.jobs.models import WorkerHold

pytestmark = pytest.mark.django_db
SECOND = timedelta(seconds=1)


@pytest.mark.parametrize("mode", WorkerHold.Mode)
def test_a_held_worker_claims_nothing_until_it_is_resumed(kind, waiting, now, mode):
    hold_workers(workers=["w"], mode=mode, now=now)
    assert kind.claim(worker="w", now=now) is None
    assert resume_workers(workers=["w"]) == 1
    assert kind.claim(worker="w", now=now) == waiting


def test_another_worker_claims(kind, waiting, now):
    hold_workers(workers=["w"], mode=WorkerHold.Mode.PAUSED, now=now)
    assert kind.claim(worker="other", now=now) == waiting


def test_the_statement_that_claims_sees_a_hold_of_that_moment(kind, waiting, now, monkeypatch):
    monkeypatch.setattr("core.jobs.kinds.hold_of", lambda worker: "")  # seen before it was held
    hold_workers(workers=["w" * 128], mode=WorkerHold.Mode.PAUSED, now=now)
    assert kind.claim(worker="w" * 200, now=now) is None


def test_what_runs_goes_on(kind, claimed, now):
    hold_workers(workers=["first"], mode=WorkerHold.Mode.DRAINED, now=now)
    assert kind.beat(pk=claimed.pk, lease=claimed.lease, now=now + SECOND)
    assert kind.held(claimed.pk, claimed.lease).exists()


def test_the_last_order_holds(now):
    hold_workers(workers=["a", "b"], mode=WorkerHold.Mode.PAUSED, now=now)
    hold_workers(workers=["b", "b"], mode=WorkerHold.Mode.DRAINED, now=now + SECOND)
    assert (hold_of("a"), hold_of("b"), hold_of("c")) == ("paused", "drained", "")
    assert WorkerHold.objects.get(worker="b").since == now + SECOND


@pytest.mark.parametrize("row", [{"worker": "w", "mode": "tired"}, {"worker": "", "mode": "paused"}])
def test_the_database_refuses_other_orders(row, now):
    with pytest.raises(IntegrityError), transaction.atomic():
        WorkerHold.objects.create(**row, since=now)
