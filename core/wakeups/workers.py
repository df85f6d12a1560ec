"""Wake-ups for workers, sent by task name; a lost wake-up delays a job by seconds."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

from django.conf import settings
from django.db import transaction
from django.utils.module_loading import import_string

if TYPE_CHECKING:
    from celery import Celery

logger = logging.getLogger(__name__)
STALE_AFTER_S = 60  # one that nobody heard for so long is dropped; the sweep has sent another by then
PATIENCE_S = 1.0  # a page waits no longer than about this for a broker that does not answer


def wake(task: str, *, times: int = 1, **options: Any) -> None:
    """Wake up to ``times`` workers for a task after the commit. ``options``: Celery's. A broker that is down is only
    logged."""
    transaction.on_commit(lambda: send(task, times, **options), robust=True)


def send(task: str, times: int, **options: Any) -> bool:
    """Send a task ``times`` over, now. False: the broker does not answer, which is logged, and nothing else."""
    from kombu.exceptions import OperationalError  # with Celery

    app = _app()
    # a connection of its own: Celery's pool tries for six seconds to reach a broker that is down
    transport = {
        **app.conf.broker_transport_options,
        "max_retries": 0,
        "connect_retries_timeout": PATIENCE_S,
        "socket_connect_timeout": PATIENCE_S,
        "socket_timeout": PATIENCE_S,
    }
    link = app.connection_for_write(connect_timeout=PATIENCE_S, transport_options=transport)
    try:
        with link:
            for _ in range(times):
                publish(task, connection=link, retry=False, expires=STALE_AFTER_S, **options)
    except (OperationalError, OSError, *link.connection_errors, *link.channel_errors) as error:
        logger.warning("The broker does not answer (%s); the sweep wakes workers again.", error or type(error).__name__)
        return False
    return True


def publish(task: str, *, expires: int, **options: Any) -> None:
    """Hand one message over to the broker. RabbitMQ drops it after ``expires`` seconds, and so does a worker."""
    _app().send_task(task, ignore_result=True, expires=expires, expiration=expires, **options)


def _app() -> Celery:
    """The Celery app. Loading it takes a quarter of a second, and most commands wake no worker."""
    app: Celery = import_string(settings.TASK_APPLICATION)
    return app
