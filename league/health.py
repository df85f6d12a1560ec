"""Whether the site can serve: its database, its cache and its broker answer."""

from __future__ import annotations

import logging
from collections.abc import Callable

from celery import current_app
from django.core.cache import cache
from django.db import connection

log = logging.getLogger(__name__)

BROKER_TIMEOUT_S = 2


def readiness() -> dict[str, bool]:
    """What the site needs and whether it answers: ``{"database", "cache", "broker"}``."""
    return {"database": _answers(_database), "cache": _answers(_cache), "broker": _answers(_broker)}


def _answers(check: Callable[[], None]) -> bool:
    try:
        check()
    except Exception:
        log.exception("not ready: %s", check.__name__.lstrip("_"))
        return False
    return True


def _database() -> None:
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1 FROM django_migrations LIMIT 1")


def _cache() -> None:
    cache.set("health", "1", 10)


def _broker() -> None:
    with current_app.connection_for_write(connect_timeout=BROKER_TIMEOUT_S) as broker:
        broker.ensure_connection(max_retries=0, timeout=BROKER_TIMEOUT_S)
