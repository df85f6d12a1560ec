"""The wake-up: a message that says "there may be work", by the task's name. Losing one costs seconds, never a job."""

from __future__ import annotations

import logging
from typing import Any

from celery import current_app
from django.db import transaction
from kombu.exceptions import OperationalError

logger = logging.getLogger(__name__)
STALE_AFTER_S = 60  # one that nobody heard for so long is dropped; the sweep has sent another by then
PATIENCE_S = 1.0  # a page waits no longer than about this for a broker that does not answer


def wake(task: str, *, times: int = 1, **options: Any) -> None:
    """Wake up to ``times`` workers for a task, by its name, once the current transaction is committed.

    A broker that is down is logged and nothing else: the row is in the queue, and the sweep wakes again. ``options``:
    Celery's for each message.
    """
    transaction.on_commit(lambda: send(task, times, **options), robust=True)


def send(task: str, times: int, **options: Any) -> bool:
    """Send a task ``times`` over, now. False: the broker does not answer, which is logged, and nothing else."""
    # a connection of its own: Celery's pool tries for six seconds to reach a broker that is down
    transport = {
        **current_app.conf.broker_transport_options,
        "max_retries": 0,
        "connect_retries_timeout": PATIENCE_S,
        "socket_connect_timeout": PATIENCE_S,
        "socket_timeout": PATIENCE_S,
    }
    link = current_app.connection_for_write(connect_timeout=PATIENCE_S, transport_options=transport)
    try:
        with link:
            for _ in range(times):
                publish(task, connection=link, retry=False, expires=STALE_AFTER_S, **options)
    except (OperationalError, OSError, *link.connection_errors, *link.channel_errors) as error:
        logger.warning("The broker does not answer (%s); the sweep wakes workers again.", error or type(error).__name__)
        return False
    return True


def publish(task: str, **options: Any) -> None:
    """Hand one message over to the broker."""
    current_app.send_task(task, ignore_result=True, **options)
