"""The bell: a message that says "there may be work". Losing one costs a few seconds, never an evaluation."""

from __future__ import annotations

import logging
from typing import Any

from celery import Task, current_app
from django.db import transaction
from kombu.exceptions import OperationalError

logger = logging.getLogger(__name__)
STALE_AFTER_S = 60  # a bell that nobody heard for so long is dropped; the sweep has rung again by then
BELLS_AT_ONCE = 8
PATIENCE_S = 1.0  # a page waits no longer than about this for a broker that does not answer


def ring_bell(*, times: int = 1) -> None:
    """Wake up to ``times`` workers once the current transaction is committed.

    A broker that is down is logged and nothing else: the row is in the queue, and the sweep rings again.
    """
    transaction.on_commit(lambda: _ring(times), robust=True)


def _ring(times: int) -> None:
    from ..tasks import work

    send(work, times)


def send(task: Task, times: int, **options: Any) -> None:
    """Send a task ``times`` over, with Celery's ``options`` for each. What goes wrong is logged, with its trace unless
    it only is a broker that does not answer."""
    away: tuple[type[Exception], ...] = (OperationalError,)
    try:
        # a connection of its own: Celery's pool tries for six seconds to reach a broker that is down
        transport = {
            **current_app.conf.broker_transport_options,
            "max_retries": 0,
            "connect_retries_timeout": PATIENCE_S,
            "socket_connect_timeout": PATIENCE_S,
            "socket_timeout": PATIENCE_S,
        }
        with current_app.connection_for_write(connect_timeout=PATIENCE_S, transport_options=transport) as connection:
            away += connection.connection_errors
            for _ in range(times):
                task.apply_async(connection=connection, retry=False, expires=STALE_AFTER_S, **options)
    except Exception as error:  # whatever the broker's client raises: what waits stands in the queue all the same
        trace = None if isinstance(error, away) else error
        logger.warning(
            "The broker does not answer (%s); the sweep will ring again.",
            error or type(error).__name__,
            exc_info=trace,
        )
