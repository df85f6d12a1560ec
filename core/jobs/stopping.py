"""How a worker that is told to stop ends soon.

A worker is a main process, which Celery's signals reach, and the processes of its pool, which run the tasks. SIGTERM
may come to the first alone or to the whole group.
"""

from __future__ import annotations

import mmap
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import billiard
from billiard import pool
from celery.signals import worker_init, worker_process_init, worker_shutting_down

_RECEIPT_TENTHS_S = 10
_stopping = mmap.mmap(-1, 1)  # one byte that a worker shares with the processes that it forks


@worker_init.connect
def begin_worker(**kwargs: object) -> None:
    """Before a worker has its pool: a byte of its own. Workers that are forks of one process, as those of
    ``manage.py run`` are, would share that one's: the first that stops would have all others begin nothing any more."""
    global _stopping
    _stopping = mmap.mmap(-1, 1)


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
def shutdown_flag() -> Iterator[Callable[[], bool]]:
    """Within the block SIGTERM does not end the process: the function that it yields tells whether one came, or the
    worker was told to stop before, so that the work is handed back.

    Two signals come almost at once where the whole group is told: the second one may interrupt the handling of the
    first. It therefore takes no lock (setting a threading.Event does, and would wait for itself).
    """
    signalled = False

    def note(*_: object) -> None:
        nonlocal signalled
        signalled = True

    def told() -> bool:
        return signalled or is_stopping()

    if threading.current_thread() is not threading.main_thread():
        yield told
        return
    before = signal.signal(signal.SIGTERM, note)
    try:
        yield told
    finally:
        signal.signal(signal.SIGTERM, before)
