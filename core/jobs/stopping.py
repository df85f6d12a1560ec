"""Fast shutdown of a worker's main process and its pool at SIGTERM to one of them or to the group."""

import mmap
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import billiard
from billiard import pool
from celery.signals import task_postrun, task_prerun, worker_init, worker_process_init, worker_shutting_down

_RECEIPT_TENTHS_S = 10
_stopping = mmap.mmap(-1, 1)  # one byte that a worker shares with the processes that it forks
_is_busy = False  # of a process of a pool


@worker_init.connect
def begin_worker(**kwargs: object) -> None:
    """Give each worker a separate byte before its pool starts: forks of one process would share it."""
    global _stopping
    _stopping = mmap.mmap(-1, 1)


@worker_process_init.connect
def begin_process(**kwargs: object) -> None:
    """End idle pool processes at SIGTERM, and shorten their wait for the main process to read their output.

    A stopping main process does not read a task that was not acknowledged; the broker delivers it again."""
    signal.signal(signal.SIGTERM, _end_idle_process)
    pool.GUARANTEE_MESSAGE_CONSUMPTION_RETRY_LIMIT = _RECEIPT_TENTHS_S


@task_prerun.connect
def begin_task(**kwargs: object) -> None:
    """From here on this process is not idle."""
    global _is_busy
    _is_busy = True


@task_postrun.connect
def end_task(**kwargs: object) -> None:
    """This process is idle again."""
    global _is_busy
    _is_busy = False


def _end_idle_process(*_: object) -> None:
    if not _is_busy and not is_stopping():
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTERM)


@worker_shutting_down.connect
def pass_on_shutdown(**kwargs: object) -> None:
    """Signal running tasks to hand their work back, where Celery would wait for them."""
    _stopping[0] = 1
    for process in billiard.active_children():
        with suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGTERM)


def is_stopping() -> bool:
    """Whether the worker of this process is stopping. False in every other process."""
    return _stopping[0] == 1


@contextmanager
def shutdown_flag() -> Iterator[Callable[[], bool]]:
    """Hold back SIGTERM within the block; the yielded function returns whether the work must be handed back.

    The handler takes no lock: a second signal may interrupt it."""
    signalled = False

    def note(*_: object) -> None:
        nonlocal signalled
        signalled = True

    def must_stop() -> bool:
        return signalled or is_stopping()

    if threading.current_thread() is not threading.main_thread():
        yield must_stop
        return
    before = signal.signal(signal.SIGTERM, note)
    try:
        yield must_stop
    finally:
        signal.signal(signal.SIGTERM, before)
