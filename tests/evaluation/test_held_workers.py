"""Real workers that are paused and drained: one finishes what it runs and ends, another leaves messages to others."""

from __future__ import annotations

import pytest

from core.database.clock import database_now
from core.jobs import DRAINED_STATUS
from evaluation.models import Evaluation, State, WorkerNode
from evaluation.running.worker_nodes import order_workers
from tests.evaluation.processes import wait_for
from tests.evaluation.test_processes import Control, broker_url, finished, submit  # noqa: F401

pytestmark = [
    pytest.mark.slow,
    pytest.mark.django_db(transaction=True),
    pytest.mark.xdist_group("workers"),
]


@pytest.fixture
def control(tmp_path):
    return Control(tmp_path)


def order(what, *names):
    order_workers(names=[f"{name}@test" for name in names], order=what, now=database_now())


def test_a_drained_worker_finishes_and_ends_until_it_is_resumed(submit, control, broker_url):  # noqa: F811
    with control.worker(broker_url, BEAT_EVERY_S="0.3") as worker:
        control.hold_at("running")
        first = submit()
        control.held()
        second = submit(seed=1)
        order("drain", "w")
        assert worker.poll() is None and not finished(first)
        (control.folder / "go").touch()
        assert worker.wait(30) == DRAINED_STATUS
    assert finished(first)
    assert WorkerNode.objects.get().stopped_at is not None
    with control.worker(broker_url, BEAT_EVERY_S="0.3") as again:
        assert again.wait(30) == DRAINED_STATUS
    assert Evaluation.objects.get(pk=second.pk).state == State.QUEUED
    order("resume", "w")
    with control.worker(broker_url):
        wait_for(lambda: finished(second), 30, control.log)


def test_of_two_workers_the_paused_one_leaves_messages_to_the_other(submit, control, broker_url):  # noqa: F811
    def handed_over(name, to_others):
        wait_for(
            lambda: f"{name}@test leaves messages to others: {to_others}" in control.log.read_text(), 30, control.log
        )

    def driven_by():
        run = submit(seed=Evaluation.objects.count())
        wait_for(lambda: finished(run), 30, control.log)
        return Evaluation.objects.get(pk=run.pk).worker

    fast = {"BEAT_EVERY_S": "0.3"}
    with control.worker(broker_url, "a", **fast), control.worker(broker_url, "b", **fast):
        order("pause", "a")
        handed_over("a", True)
        assert {driven_by() for _ in range(4)} == {"b@test"}
        order("pause", "b")
        handed_over("a", False)
        order("resume", "a")
        handed_over("b", True)
        assert {driven_by() for _ in range(4)} == {"a@test"}
