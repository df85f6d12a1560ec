"""The trainers' bell: a message that says "there may be a training to do", on a queue of its own."""

from __future__ import annotations

import logging

from celery import current_app
from django.db import transaction

from evaluation.services.bell import PATIENCE_S, STALE_AFTER_S

logger = logging.getLogger(__name__)
QUEUE = "training"


def ring_training_bell(*, times: int = 1) -> None:
    """Wake up to ``times`` trainers once the current transaction is committed. A broker that is down is logged and
    nothing else: the sweep rings again."""
    transaction.on_commit(lambda: _ring(times), robust=True)


def _ring(times: int) -> None:
    from ..tasks import train

    try:
        options = {
            **current_app.conf.broker_transport_options,
            "max_retries": 0,
            "connect_retries_timeout": PATIENCE_S,
            "socket_connect_timeout": PATIENCE_S,
            "socket_timeout": PATIENCE_S,
        }
        with current_app.connection_for_write(connect_timeout=PATIENCE_S, transport_options=options) as connection:
            for _ in range(times):
                train.apply_async(connection=connection, queue=QUEUE, retry=False, expires=STALE_AFTER_S)
    except Exception as error:  # whatever the broker's client raises: the job stands all the same
        logger.warning("The broker does not answer (%s); the sweep will ring again.", error or type(error).__name__)
