"""The bell: a message that says "there may be work". Losing one costs a few seconds, never an evaluation."""

from __future__ import annotations

import logging

from django.db import transaction

logger = logging.getLogger(__name__)
STALE_AFTER_S = 60  # a bell that nobody heard for so long is dropped; the sweep has rung again by then


def ring_bell(*, times: int = 1) -> None:
    """Wake up to ``times`` workers once the current transaction is committed.

    A broker that is down is logged and nothing else: the row is in the queue, and the sweep rings again.
    """
    transaction.on_commit(lambda: _ring(times), robust=True)


def _ring(times: int) -> None:
    from ..tasks import work

    try:
        for _ in range(times):
            work.apply_async(retry=False, expires=STALE_AFTER_S)
    except Exception as error:  # whatever the broker's client raises: the submission stands all the same
        logger.warning("The broker does not answer (%s); the sweep will ring again.", error or type(error).__name__)
