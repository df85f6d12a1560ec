"""Whether the site has all that it needs, part by part and each by its name.

Anybody may ask, and some of the parts are costly to look at: a process looks at most every :data:`KEPT_S` seconds, one
thread at a time, and tells all who ask meanwhile what it found.
"""

from __future__ import annotations

import logging
import shutil
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import timedelta
from time import monotonic
from typing import Any

from celery import current_app
from django.conf import settings
from django.core.cache import cache, caches
from django.db import DatabaseError, connection, transaction
from django.db.migrations.executor import MigrationExecutor
from django.db.migrations.recorder import MigrationRecorder
from kombu.exceptions import KombuError
from redis import RedisError

from core.clock import database_now
from core.jobs.outages import storage_answers, storage_is_out
from core.streams import life
from evaluation.models import WorkerNode
from evaluation.selectors import waiting_since
from evaluation.services import EVALUATIONS
from evaluation.services.nodes import SILENT_AFTER
from paddock.errors import PlatformFault

from .cache import SteadyCache
from .pages import are_whole

log = logging.getLogger(__name__)

BROKER_TIMEOUT_S = WRITE_TIMEOUT_S = 2
KEPT_S = 5.0
FAILS = (DatabaseError, OSError, RedisError, KombuError, PlatformFault)  # what the parts fail with
NOBODY_CAME = timedelta(minutes=1)  # a run that waits longer has no worker


@dataclass(frozen=True)
class Readiness:
    """``parts``: what the site needs by name, and whether it is as it should be; ``figures``: what was measured."""

    parts: dict[str, bool] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)

    @property
    def is_ready(self) -> bool:
        return all(self.parts.values())


_looking = threading.Lock()
_last: tuple[float, Readiness] | None = None


def readiness() -> Readiness:
    """What was found at most :data:`KEPT_S` seconds ago, or before the look that is being taken now: a part that does
    not answer keeps one request of this process waiting, and not every thread of it."""
    global _last
    before = _last
    if not _looking.acquire(blocking=before is None) and before is not None:
        return before[1]
    try:
        if _last is None or monotonic() - _last[0] > KEPT_S:
            found = look()
            _last = (monotonic(), found)
        return _last[1]
    finally:
        _looking.release()


def look() -> Readiness:
    """Look at everything now. Nothing that is broken raises."""
    figures: dict[str, Any] = {}
    checks: dict[str, Callable[[], bool]] = {
        "database": _database,
        "writes": _writes,
        "pages": are_whole,
        "migrations": _migrations,
        "cache": _cache,
        "broker": _broker,
        "storage": _storage,
        "disk": lambda: _disk(figures),
        "workers": lambda: _workers(figures),
        "queue": lambda: _queue(figures),
    }
    # no part: without it pages ask by themselves, and a site that is taken out of service for it serves nobody
    figures["streams"] = None
    with suppress(*FAILS):
        living = life.told()
        figures["streams"] = living and living["streams"]
    return Readiness({name: _holds(name, check) for name, check in checks.items()}, figures)


def _holds(name: str, check: Callable[[], bool]) -> bool:
    try:
        good = check()
    except FAILS as error:
        log.error("not ready: %s (%s)", name, error.__cause__ or error)
        return False
    if not good:
        log.error("not ready: %s", name)
    return good


def _database() -> bool:
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1 FROM django_migrations LIMIT 1")
    return True


def _writes() -> bool:
    """Whether a row can be written, and soon: not on a full disk, a read-only standby, or behind a lock that stays."""
    rows = MigrationRecorder(connection).migration_qs
    first = rows.order_by("pk").values_list("pk", "name").first()
    if first is None:
        return False
    if connection.vendor == "postgresql":
        with transaction.atomic(), connection.cursor() as cursor:
            cursor.execute(f"SET LOCAL lock_timeout = '{WRITE_TIMEOUT_S}s'")
            return bool(rows.filter(pk=first[0]).update(name=first[1]))
    with connection.cursor() as cursor:
        patience = cursor.execute("PRAGMA busy_timeout").fetchone()[0]
        cursor.execute(f"PRAGMA busy_timeout = {WRITE_TIMEOUT_S * 1000}")
        try:
            return bool(rows.filter(pk=first[0]).update(name=first[1]))
        finally:
            cursor.execute(f"PRAGMA busy_timeout = {patience}")


def _migrations() -> bool:
    """Whether all that this code knows have been made. A newer site may have made more."""
    executor = MigrationExecutor(connection)
    return not executor.migration_plan(executor.loader.graph.leaf_nodes())


def _cache() -> bool:
    """Whether the server answers; without it the site goes on (:mod:`config.cache`)."""
    if isinstance(caches["default"], SteadyCache):
        return caches["default"].answers()
    cache.set("health", "1", 10)
    return cache.get("health") == "1"


def _broker() -> bool:
    with current_app.connection_for_write(connect_timeout=BROKER_TIMEOUT_S) as broker:
        broker.ensure_connection(max_retries=0, timeout=BROKER_TIMEOUT_S)
    return True


def _storage() -> bool:
    """Whether files can be written and read, and evaluations are not held back because they could not."""
    return storage_answers() and not storage_is_out()


def _disk(figures: dict[str, Any]) -> bool:
    free_mb = shutil.disk_usage(settings.DATA_DIR).free // 2**20
    figures["disk_free_mb"] = free_mb
    return free_mb >= settings.LOW_DISK_MB


def _workers(figures: dict[str, Any]) -> bool:
    """Whether somebody runs what waits: a worker for evaluations lives and takes work; or there is no sign that one
    should, because all were shut down in good order and nobody waits."""
    now = database_now()
    known = [node for node in WorkerNode.objects.filter(stopped_at=None) if EVALUATIONS.queue in node.queues]
    living = [node for node in known if node.seen_at >= now - SILENT_AFTER]
    figures["workers"] = len(living)
    if any(not node.refuses for node in living):
        return True
    since = waiting_since()
    return not known and (since is None or now - since < NOBODY_CAME)


def _queue(figures: dict[str, Any]) -> bool:
    since = waiting_since()
    waits_s = 0 if since is None else max(0, int((database_now() - since).total_seconds()))
    figures["oldest_waits_s"] = waits_s
    return waits_s <= settings.QUEUE_ALARM_MINUTES * 60
