"""The heartbeat of Celery's programs: workers of every queue and the scheduler.

Each program writes its row from its own main loop and closes the connection after each beat. A program in which a loop
stands still is ended by SIGALRM after :data:`HUNG_AFTER_S`; a worker that takes nothing from a queue in which messages
wait ends with exit status 1. The scheduler is a program (``celery beat``), or a thread of a worker (``celery worker
--with-scheduler``). Django is imported once the program is up.
"""

import logging
import signal
import socket
from collections.abc import Callable
from math import ceil
from time import monotonic
from typing import Any, TypedDict

import click
from celery import bootsteps
from celery.beat import EmbeddedService, PersistentScheduler
from celery.exceptions import WorkerShutdown
from celery.signals import worker_shutdown
from celery.worker import state

from core.jobs import DRAINED_STATUS

from . import SCHEDULER

logger = logging.getLogger(__name__)
HUNG_AFTER_S = 120
FIRST_BEAT_S = 1.0  # of a drained worker that was started: it ends again
IDLE_BEATS = 4  # in a row, with messages in the queue and none taken
NAME = f"{SCHEDULER}@{socket.gethostname()}"
WITH_SCHEDULER = click.Option(["--with-scheduler"], is_flag=True, help="Run the scheduler as a thread of this worker.")
_turned: dict[str, float] = {}  # by the name of a row of this process: when its loop turned last


class WorkerRow(TypedDict):
    """A program's columns of :class:`evaluation.models.WorkerNode`."""

    name: str
    queues: list[str]
    processes: int


class WorkerHeartbeat(bootsteps.StartStopStep):
    """A part of Celery's consumer: it beats while the worker is connected, again after a lost broker."""

    requires = ("celery.worker.consumer.tasks:Tasks",)

    def __init__(self, consumer: Any, **kwargs: Any) -> None:
        super().__init__(consumer, **kwargs)
        self._timer: Any = None
        self._name = ""
        self._taken, self._idle = 0, 0
        self._held = False

    def start(self, consumer: Any) -> None:
        from .worker_nodes import BEAT_EVERY_S

        self._idle = 0
        self._name = consumer.hostname
        queues = list(consumer.app.amqp.queues.consume_from)
        worker: WorkerRow = {
            "name": consumer.hostname,
            "queues": queues,
            "processes": int(consumer.controller.max_concurrency or consumer.controller.concurrency or 1),
        }

        def beat() -> None:
            _beat(worker)
            self._follow_hold(consumer, queues)
            self._require_progress(consumer.task_consumer.channel, queues)

        _start(worker)
        self._held = False  # the consumer was just made, and reads all queues
        consumer.timer.call_after(FIRST_BEAT_S, self._follow_hold, (consumer, queues))
        self._timer = consumer.timer.call_repeatedly(BEAT_EVERY_S, beat)

    def stop(self, consumer: Any) -> None:
        _stop_watching(self._name)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _follow_hold(self, consumer: Any, queues: list[str]) -> None:
        """Leave the messages to others while this worker is held and others read its queues; end when it is drained and
        free."""
        from core.jobs.holds import hold_of
        from core.jobs.models import WorkerHold

        from .worker_nodes import others_listen

        mode = _written(lambda: hold_of(self._name))
        if mode is None:  # the database is away
            return
        if mode == WorkerHold.Mode.DRAINED and not state.reserved_requests:
            logger.warning("%s is drained: it ends.", self._name)
            raise WorkerShutdown(DRAINED_STATUS)
        held = bool(mode) and bool(_written(lambda: others_listen(name=self._name, queues=queues)))
        if held == self._held:
            return
        logger.info("%s leaves messages to others: %s.", self._name, held)
        for queue in queues:
            if held:
                consumer.task_consumer.cancel_by_queue(queue)
            else:
                consumer.task_consumer.add_queue(consumer.app.amqp.queues[queue])
                consumer.task_consumer.consume()
        self._held = held

    def _require_progress(self, channel: Any, queues: list[str]) -> None:
        """End the worker with exit status 1 if it is free and leaves messages in its queues: Celery can lose its
        consumer while it reconnects. Only Redis tells a queue's size without cost."""
        taken = sum(state.total_count.values())
        size = getattr(channel, "_size", lambda queue: 0)
        free = taken == self._taken and not state.active_requests and not self._held
        self._idle = self._idle + 1 if free and any(size(queue) for queue in queues) else 0
        self._taken = taken
        if self._idle >= IDLE_BEATS:
            logger.critical("Messages wait and this worker takes none: it ends, to be started again.")
            raise WorkerShutdown(1)


class BeatingScheduler(PersistentScheduler):
    """Celery's scheduler with a row among the workers."""

    _due = 0.0

    def tick(self, *arguments: Any, **options: Any) -> float:
        from .worker_nodes import BEAT_EVERY_S

        if monotonic() >= self._due:
            (_beat if self._due else _start)({"name": NAME, "queues": [SCHEDULER], "processes": 1})
            self._due = monotonic() + BEAT_EVERY_S
        return super().tick(*arguments, **options)

    def close(self) -> None:
        from .worker_nodes import stop_worker

        _stop_watching(NAME)
        _written(lambda: stop_worker(name=NAME))
        super().close()


class EmbeddedScheduler(bootsteps.StartStopStep):
    """A part of Celery's worker: the scheduler as a thread, where ``--with-scheduler`` asks for it."""

    def __init__(self, worker: Any, with_scheduler: bool = False, **options: Any) -> None:
        super().__init__(worker, **options)
        self.enabled = with_scheduler

    def create(self, worker: Any) -> Any:
        return EmbeddedService(
            worker.app,
            thread=True,
            scheduler_cls=worker.app.conf.beat_scheduler,
            schedule_filename=worker.app.conf.beat_schedule_filename,
        )


@worker_shutdown.connect
def say_goodbye(sender: Any = None, **kwargs: object) -> None:
    """Record that the worker stops. After a fault the row stays, so that the worker is reported as silent."""
    from .worker_nodes import stop_worker

    if getattr(sender, "hostname", None) and getattr(sender, "exitcode", None) in (None, 0, DRAINED_STATUS):
        _written(lambda: stop_worker(name=sender.hostname))


def _watch(name: str) -> None:
    """A loop turns: SIGALRM comes when one of this process has not turned for :data:`HUNG_AFTER_S`."""
    _turned[name] = monotonic()
    _set_alarm()


def _stop_watching(name: str) -> None:
    _turned.pop(name, None)
    _set_alarm()


def _set_alarm() -> None:
    last = min(_turned.copy().values(), default=None)
    signal.alarm(0 if last is None else max(1, ceil(last + HUNG_AFTER_S - monotonic())))


def _start(row: WorkerRow) -> None:
    from .worker_nodes import start_worker

    _watch(row["name"])
    _written(lambda: start_worker(**row))


def _beat(row: WorkerRow) -> None:
    """Write the row's heartbeat, or the row where it is missing or belongs to an earlier process."""
    from .worker_nodes import beat_worker

    _watch(row["name"])
    if _written(lambda: beat_worker(name=row["name"])) is False:
        _start(row)


def _written(call: Callable[[], Any]) -> Any:
    """What ``call`` answers. A database that is away is logged, and no reason to stop working."""
    from django.db import DatabaseError, connections

    try:
        return call()
    except DatabaseError as error:
        logger.warning("The heartbeat could not be written", exc_info=error)
        return None
    finally:
        connections.close_all()
