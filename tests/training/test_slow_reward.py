"""Trainings whose reward function is slow: they end at their limit, stop when asked, and report the milliseconds."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from django.db import connections
from django.utils import timezone

from evaluation.sandbox.probe import probe
from paddock.errors import UserFault
from paddock.geometry.catalogue import CATALOGUE
from tests.soak import only
from tests.training.jobs import a_training
from tests.training.specs import a_spec
from training.jobs.selectors import how_it_ended
from training.jobs.services.queue import stop_training
from training.jobs.services.worker import run_next_training
from training.models import JobState, TrainingJob
from training.trainer.client import Ended, Listener, train

pytest.importorskip("torch", reason="training is not installed: make training")
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("training")]

OVAL = next(track for track in CATALOGUE if track.slug == "oval").geometry()
LOOP = """
def reward_function(params):
    total = 0
    for number in range(3_000_000):
        total += number
    return 1.0
"""
CATCHES_ALL = """
def count():
    total = 0
    for number in range(300_000):
        total += number


def reward_function(params):
    for _ in range(10):
        try:
            count()
        except BaseException:
            raise ValueError("of its own")
    return 1.0
"""
SLOW_TO_LOAD = "total = 0\nfor number in range(20_000_000):\n    total += number\n" + LOOP
SLOW_LATE = """
calls = 0


def reward_function(params):
    global calls
    calls += 1
    for _ in range(3_000_000 if calls > 70 else 0):
        pass
    return 1.0
"""


class Heard(Listener):
    def __init__(self) -> None:
        self.began = 0.0
        self.slow: list[float] = []
        self.iterations: list[Any] = []

    def ready(self) -> None:
        self.began = time.monotonic()

    def iteration(self, iteration: Any) -> None:
        self.iterations.append(iteration)

    def reward_time(self, milliseconds: float) -> None:
        self.slow.append(milliseconds)


def ended(code: str, stop_s: float | None = None, **changes: Any) -> tuple[Ended, Heard, float]:
    """How a training of this function ends, what it reported, and the seconds after its limit or after the stop, which
    is asked for as soon as a call of the function is reported, and after ``stop_s`` at the latest."""
    if probe().level < 2:
        pytest.skip("this host offers no wall")
    heard = Heard()
    asked: list[float] = []

    def ask() -> bool:
        now = time.monotonic()
        if stop_s and not asked and (heard.slow or (heard.began and now > heard.began + stop_s)):
            asked.append(now)
        return bool(asked)

    end = train(a_spec(OVAL, reward_code=code, **changes), heard, asked_to_stop=ask)
    return end, heard, time.monotonic() - (asked[0] if asked else heard.began + changes["stop_seconds"])


@pytest.mark.parametrize("code", only([CATCHES_ALL], [LOOP, CATCHES_ALL]))
def test_the_time_limit_holds_before_the_first_update(code):
    end, heard, late = ended(code, stop_seconds=6.0)
    assert (end.why, bool(end.network), bool(end.sb3_zip)) == ("time", True, True)
    assert late < 4.0
    assert end.reward_ms > 20.0 and heard.slow, "milliseconds of a call"
    assert end.steps >= 1


@pytest.mark.parametrize("code", only([CATCHES_ALL, SLOW_TO_LOAD], [LOOP, CATCHES_ALL, SLOW_TO_LOAD]))
def test_a_stop_is_obeyed_within_three_seconds(code):
    end, _, late = ended(code, stop_s=4.0, stop_seconds=600.0)
    assert (end.why, bool(end.network), bool(end.sb3_zip)) == ("stopped", True, True)
    assert late < 3.0


@pytest.mark.parametrize("algorithm", only(["ppo"], ["ppo", "sac"]))
def test_a_function_that_becomes_slow_keeps_what_was_learned(algorithm):
    short = {"num_episodes_between_training": 5, "batch_size": 64, "num_epochs": 3}
    end, heard, late = ended(SLOW_LATE, algorithm=algorithm, hyperparameters=short, trials=1, stop_seconds=12.0)
    assert end.why == "time" and heard.iterations and not end.network
    assert late < 4.0


def test_time_used_up_while_loading_names_the_lines_outside_of_the_function():
    with pytest.raises(UserFault) as fault:
        ended(SLOW_TO_LOAD, stop_seconds=3.0)
    assert fault.value.code == "reward_slow_to_load"
    assert fault.value.params["ms"] > 100


@pytest.mark.django_db(transaction=True)
@pytest.mark.usefixtures("training_wakes", "wakes")
def test_the_owner_stops_it_and_reads_the_milliseconds(alice, oval, now):
    job = a_training(alice, oval, now, reward_code=LOOP)
    asked: list[float] = []

    def stop() -> None:
        until = time.monotonic() + 60
        while time.monotonic() < until and not asked:
            row = TrainingJob.objects.get(pk=job.pk)
            if row.progress.get("reward_ms"):
                stop_training(job=row, now=timezone.now())
                asked.append(time.monotonic())
            time.sleep(0.1)
        connections.close_all()

    thread = threading.Thread(target=stop)
    thread.start()
    assert run_next_training(worker="tester")
    thread.join()
    job.refresh_from_db()
    assert (job.state, job.reason_code, job.operator_detail) == (JobState.STOPPED, "", "")
    assert job.best_model is not None and job.sb3_zip
    assert (job.ended_at - job.stop_asked_at).total_seconds() < 5.0
    assert job.reward_ms > 20.0
    assert "ms" in how_it_ended(job, alice)
