"""The heartbeat of a Celery worker, of whatever queue: written by its main process, so that a long job is no silence.

It is written by the worker's own timer in the main thread, between two turns of its loop: a thread of its own could
hold a lock of the database's library at the very moment in which the pool forks. The connection is closed after each
beat, so that no process of the pool inherits one. Nothing of Django is imported before the worker has come up.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from celery import bootsteps
from celery.signals import worker_shutdown

logger = logging.getLogger(__name__)


class WorkerHeartbeat(bootsteps.StartStopStep):
    """A part of Celery's consumer: it beats for as long as the worker is connected, again after a lost broker."""

    requires = ("celery.worker.consumer.tasks:Tasks",)

    def __init__(self, consumer: Any, **kwargs: Any) -> None:
        super().__init__(consumer, **kwargs)
        self._timer: Any = None

    def start(self, consumer: Any) -> None:
        """Write the worker's row, and from now on beat."""
        from .services.nodes import BEAT_EVERY_S, beat_worker, start_worker

        worker = {
            "name": consumer.hostname,
            "queues": list(consumer.app.amqp.queues.consume_from),
            "processes": int(consumer.controller.concurrency or 1),
        }

        def beat() -> None:
            if _written(lambda: beat_worker(name=consumer.hostname)) is False:  # forgotten meanwhile
                _written(lambda: start_worker(**worker))

        _written(lambda: start_worker(**worker))
        self._timer = consumer.timer.call_repeatedly(BEAT_EVERY_S, beat)

    def stop(self, consumer: Any) -> None:
        """The connection is lost or the worker ends."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


@worker_shutdown.connect
def say_goodbye(sender: Any = None, **kwargs: object) -> None:
    """The worker was told to stop."""
    from .services.nodes import stop_worker

    if getattr(sender, "hostname", None):
        _written(lambda: stop_worker(name=sender.hostname))


def _written(call: Callable[[], Any]) -> Any:
    """What ``call`` answers. A database that is away is logged, and no reason to stop working."""
    from django.db import DatabaseError, connections

    try:
        return call()
    except DatabaseError as error:
        logger.warning("The worker's heartbeat could not be written: %s", error)
        return None
    finally:
        connections.close_all()
