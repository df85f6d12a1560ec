"""How a worker that is told to stop ends soon.

A worker is a main process, which Celery's signals reach, and the processes of its pool, which run the tasks. SIGTERM
may come to the first alone or to the whole group.
"""

from __future__ import annotations

import mmap
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import billiard
from billiard import pool
from celery.signals import worker_process_init, worker_shutting_down

_RECEIPT_TENTHS_S = 10
_stopping = mmap.mmap(-1, 1)  # one byte that a worker shares with the processes that it forks


@worker_process_init.connect
def begin_process(**kwargs: object) -> None:
    """A SIGTERM to the whole group reaches the pool's processes too; Celery's main process ends idle ones itself.

    At its end a process of the pool waits until the main process has read what it sent, half a minute at most. But that
    one reads nothing more for a task that it had handed over, and not yet heard of, when it was told to stop. It counts
    the task as not begun, the broker delivers it again, and nothing is lost: the wait need not be long.
    """
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    pool.GUARANTEE_MESSAGE_CONSUMPTION_RETRY_LIMIT = _RECEIPT_TENTHS_S


@worker_shutting_down.connect
def pass_on_shutdown(**kwargs: object) -> None:
    """Celery waits for running tasks when it is told to stop; tell them to hand their work back instead, and those
    that are on their way to a process not to begin any."""
    _stopping[0] = 1
    for process in billiard.active_children():
        with suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGTERM)


def is_stopping() -> bool:
    """Whether the worker of this process was told to stop. False in every other process."""
    return _stopping[0] == 1


@contextmanager
def shutdown_flag() -> Iterator[threading.Event]:
    """An event that SIGTERM sets, so that a worker which is told to stop hands its work back; set from the start where
    it was told before."""
    told = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield told
        return
    before = signal.signal(signal.SIGTERM, lambda *_: told.set())
    try:
        if is_stopping():  # asked after the handler is there: nothing comes in between
            told.set()
        yield told
    finally:
        signal.signal(signal.SIGTERM, before)
