"""``manage.py workers``: the list, and orders by name or for all."""

from __future__ import annotations

import json
from datetime import timedelta
from io import StringIO

import pytest
from django.core.management import CommandError, call_command
from django.utils import timezone

from core.jobs.holds import hold_of
from core.management.base import Refusal
from evaluation.models import Evaluation, State
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.worker_nodes import forget_workers, start_worker, stop_worker
from paddock.rules.race import RaceRules
from tests.rows import model_row

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def workers(wakes):
    start_worker(name="worker@one", queues=["celery"], processes=2)
    start_worker(name="trainer@two", queues=["training"], processes=1)
    start_worker(name="scheduler@one", queues=["scheduler"], processes=1)


def command(*arguments: str) -> str:
    out = StringIO()
    call_command("workers", *arguments, stdout=out)
    return out.getvalue()


def states(*arguments: str) -> dict[str, str]:
    return {row["name"]: row["state"] for row in json.loads(command(*arguments, "--json"))["workers"]}


def test_the_list_has_the_machine_the_state_and_what_runs(alice, oval):
    run = queue_evaluation(owner=alice, model=model_row(alice), track=oval, rules=RaceRules(), now=timezone.now())
    claimed = {"state": State.RUNNING, "lease": "0" * 32, "leased_until": timezone.now(), "started_at": timezone.now()}
    Evaluation.objects.filter(pk=run.pk).update(worker="worker@one", **claimed)
    (line,) = [line for line in command().splitlines() if line.startswith("worker@one")]
    assert line.split()[:4] == ["worker@one", "one", "alive", "celery"] and f"evaluations {run}" in line
    (row,) = [row for row in json.loads(command("--json"))["workers"] if row["name"] == "worker@one"]
    assert row["runs"] == [f"evaluations {run}"] and row["since"] and row["held_since"] is None


def test_a_worker_is_paused_drained_and_resumed():
    assert states("--pause", "worker@one")["worker@one"] == "paused"
    assert states("--drain", "worker@one", "trainer@two")["worker@one"] == "draining"
    stop_worker(name="worker@one")
    assert states() == {"worker@one": "drained", "trainer@two": "draining", "scheduler@one": "alive"}
    assert states("--resume", "worker@one")["worker@one"] == "stopped"
    assert hold_of("trainer@two") == "drained"


def test_all_are_all_but_the_scheduler():
    assert states("--pause", "all") == {"worker@one": "paused", "trainer@two": "paused", "scheduler@one": "alive"}
    assert set(states("--resume", "all").values()) == {"alive"}


def test_a_forgotten_worker_stays_held_and_can_be_resumed():
    command("--drain", "worker@one")
    forget_workers(now=timezone.now() + timedelta(days=3))
    assert hold_of("worker@one") == "drained"
    command("--resume", "all")
    assert hold_of("worker@one") == ""


def test_an_unknown_name_changes_nothing():
    with pytest.raises(Refusal, match="worker_unknown: There is no worker nobody@one") as refused:
        command("--pause", "worker@one", "nobody@one")
    assert refused.value.returncode == 2 and hold_of("worker@one") == ""


def test_one_order_at_a_time():
    with pytest.raises(CommandError, match="not allowed with"):
        command("--pause", "worker@one", "--resume", "worker@one")
