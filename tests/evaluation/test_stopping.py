"""How a worker hears that it is to stop. What real workers then do: test_processes.py."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator

import pytest

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
