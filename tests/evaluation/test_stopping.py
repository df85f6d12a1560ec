"""How a worker hears that it is to stop. What real workers then do: test_processes.py."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator

import pytest
from celery.signals import task_postrun, task_prerun, worker_init

from core.jobs import stopping
from core.jobs.stopping import shutdown_flag


@pytest.fixture
def no_hanging() -> Iterator[None]:
    """Five seconds for a test, which an exception then ends."""

    def late(*_: object) -> None:
        raise AssertionError("it hangs")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(5)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def test_sigterm_is_noted_inside_the_block_only():
    before = signal.getsignal(signal.SIGTERM)
    with shutdown_flag() as told:
        assert not told()
        os.kill(os.getpid(), signal.SIGTERM)
        assert told()
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_second_sigterm_may_interrupt_the_first_at_any_line(no_hanging):
    """As where a whole group is told: once by the group's signal and once more by the worker, which passes it on."""
    traced = sys.gettrace()

    def again(frame, event, argument):
        os.kill(os.getpid(), signal.SIGTERM)
        return again

    with shutdown_flag() as told:
        handler = signal.getsignal(signal.SIGTERM)
        sys.settrace(again)
        try:
            handler(signal.SIGTERM, None)
        finally:
            sys.settrace(traced)
        assert told()


def test_a_task_started_after_the_signal_knows_of_it(monkeypatch):
    monkeypatch.setattr(stopping, "_stopping", bytearray(1))
    monkeypatch.setattr(stopping.billiard, "active_children", list)
    stopping.pass_on_shutdown()
    with shutdown_flag() as told:
        assert told()


def test_a_worker_that_stops_stops_no_other_fork_of_the_same_process():
    """As the programs of ``manage.py run`` are: what had loaded this module forks the workers, and they their pools."""

    def of_a_worker(told: bool) -> bool:
        worker_init.send(sender=None)
        if told:
            stopping.pass_on_shutdown()
        return said_by_a_fork(stopping.is_stopping)

    assert said_by_a_fork(lambda: of_a_worker(told=True)), "the processes of its pool know"
    assert not said_by_a_fork(lambda: of_a_worker(told=False))
    assert not stopping.is_stopping()


def said_by_a_fork(question: Callable[[], bool]) -> bool:
    pid = os.fork()
    if pid == 0:
        status = 2
        try:
            status = int(question())
        finally:
            os._exit(status)
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    assert status in (0, 1), status
    return bool(status)


def test_an_idle_process_of_a_pool_ends_by_sigterm_and_one_at_work_does_not():
    """As Celery ends one that ``--autoscale`` needs no more."""

    def outlives(sigterm_when: str) -> bool:
        def question() -> bool:
            stopping.begin_process()
            if sigterm_when != "idle":
                task_prerun.send(sender=None)
            if sigterm_when == "idle again":
                task_postrun.send(sender=None)
            os.kill(os.getpid(), signal.SIGTERM)
            return True

        pid = os.fork()
        if pid == 0:
            os._exit(0 if question() else 2)
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0

    assert not outlives("idle")
    assert outlives("at work")
    assert not outlives("idle again")
