"""Waking readers once an event is committed. A wake-up that gets lost costs a minute: the sweep wakes them all."""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import dataclass
from time import monotonic

from celery import current_app
from django.db import connection, transaction
from kombu.exceptions import OperationalError

logger = logging.getLogger(__name__)
FOLLOW = "core.events.tasks.follow"
STALE_AFTER_S = 60
PATIENCE_S = 1.0  # a page waits no longer than about this for a broker that does not answer
LEFT_ALONE_S = 5.0
_INTERESTED: dict[str, set[str]] = {}
_away_until = 0.0


def interested(reader: str, kinds: set[str]) -> None:
    """Remember which kinds of events wake a reader."""
    _INTERESTED[reader] = kinds


def wake_readers(kinds: Collection[str]) -> None:
    """Wake whoever reads events of these kinds, once, when the present transaction is committed."""
    waiting = {call for _savepoints, call, _robust in connection.run_on_commit if isinstance(call, _WakeUp)}
    for reader, wanted in _INTERESTED.items():
        call = _WakeUp(reader)
        if wanted.intersection(kinds) and call not in waiting:
            transaction.on_commit(call, robust=True)


@dataclass(frozen=True)
class _WakeUp:
    reader: str

    def __call__(self) -> None:
        wake(self.reader)


def wake(reader: str) -> None:
    """Ask a worker to let a reader follow. A broker that is away is logged, and left alone for a moment, so that nobody
    waits for it several times."""
    global _away_until
    if monotonic() < _away_until:
        return
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
            current_app.send_task(FOLLOW, args=[reader], connection=link, retry=False, expires=STALE_AFTER_S)
    except (OperationalError, OSError, *link.connection_errors, *link.channel_errors) as error:
        _away_until = monotonic() + LEFT_ALONE_S
        logger.warning("The broker does not answer (%s); the sweep wakes the readers again.", error)
