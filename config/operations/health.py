"""Checks every part that the site needs and reports each by name; ``doctor`` shows the same parts.

Each check runs in a thread with a deadline. A check that misses it has failed, and does not run again before its thread
has ended. An answer comes within :data:`BOUND_S`. The web processes of a machine share the last result for
:data:`KEPT_S` seconds through a file.
"""

import fcntl
import json
import logging
import shutil
import threading
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import timedelta
from functools import partial
from queue import SimpleQueue
from time import monotonic, sleep, time
from typing import TextIO

from django.conf import settings
from django.core.cache import caches
from django.core.cache.backends.base import BaseCache
from django.db import DatabaseError, connection, connections, transaction
from django.db.migrations.recorder import MigrationRecorder
from kombu.exceptions import KombuError
from redis import RedisError

from core.database.clock import database_now
from core.database.known_migrations import applied_are_all
from core.jobs.holds import holds_by_worker
from core.jobs.outages import storage_answers, storage_is_out
from core.streams import life
from evaluation.models import WorkerNode
from evaluation.running import SCHEDULER
from evaluation.running.queue.jobs import EVALUATIONS
from evaluation.running.queue.selectors import waiting_since
from evaluation.running.worker_nodes import SILENT_AFTER
from paddock.errors import PlatformFault
from races.rechecks.services import unexamined

from ..celery import app
from ..serving.cache import SteadyCache
from .backup.databases import damage

log = logging.getLogger(__name__)

DEADLINE_S = 2.0  # of a part
BOUND_S = 3.0  # of the whole answer
BROKER_TIMEOUT_S = WRITE_TIMEOUT_S = 1.5
KEPT_S = 5.0
FAILS = (DatabaseError, OSError, RedisError, KombuError, PlatformFault)  # what the parts fail with
NOBODY_CAME = timedelta(minutes=1)  # a run that waits longer has no worker
MESSAGES = "messages"
_DAMAGE = "damaged_pages"
Figures = dict[str, int | None]


@dataclass(frozen=True)
class Readiness:
    """``parts``: by name, whether each works; ``figures``: measurements; ``reasons``: why a part fails; ``at``: when
    the check began, ``kept_s``: for how long it may be shared."""

    parts: dict[str, bool] = field(default_factory=dict)
    figures: Figures = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    at: float = field(default_factory=time)
    kept_s: float = field(default_factory=lambda: KEPT_S)

    @property
    def is_ready(self) -> bool:
        return all(self.parts.values())

    @property
    def age_s(self) -> float:
        return max(0.0, round(time() - self.at, 1))

    @property
    def is_fresh(self) -> bool:
        return 0 <= time() - self.at <= min(KEPT_S, self.kept_s)


@dataclass(frozen=True)
class HealthCheck:
    """A look at a part; a part may have several. ``name``: of the part, empty where only figures are measured."""

    name: str
    holds: Callable[[Figures], bool]
    asks_database: bool = False
    deadline_s: float = field(default_factory=lambda: DEADLINE_S)


def checks() -> list[HealthCheck]:
    """All checks in the order of the page."""
    default = caches["default"]  # of the caller
    return [
        HealthCheck("database", lambda figures: _database(), True),
        HealthCheck("writes", lambda figures: _writes(), True),
        HealthCheck("pages", lambda figures: pages_are_intact()),
        HealthCheck("migrations", lambda figures: _migrations(), True),
        HealthCheck("cache", lambda figures: _cache(default)),
        HealthCheck("broker", lambda figures: _broker()),
        HealthCheck("storage", lambda figures: storage_answers()),
        HealthCheck("storage", lambda figures: not storage_is_out(), True),
        HealthCheck("disk", _disk),
        HealthCheck("workers", _workers, True),
        HealthCheck("messengers", lambda figures: _listens(MESSAGES), True),
        HealthCheck("scheduler", lambda figures: _listens(SCHEDULER), True),
        HealthCheck("queue", _queue, True),
        HealthCheck("results", lambda figures: not unexamined().exists(), True),
        HealthCheck("", _streams),
    ]


_asking = threading.Lock()
_last: Readiness | None = None


class _Asker(threading.Thread):
    """A thread that runs one check at a time and keeps its client connected."""

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._work: SimpleQueue[tuple[Callable[[], object], threading.Event]] = SimpleQueue()
        self.done = threading.Event()
        self.done.set()
        self.start()

    def begin(self, work: Callable[[], object]) -> threading.Event:
        self.done = threading.Event()
        self._work.put((work, self.done))
        return self.done

    def run(self) -> None:
        while True:
            work, done = self._work.get()
            try:
                work()
            finally:
                connections.close_all()
                done.set()


_askers: dict[int, _Asker] = {}


def readiness() -> Readiness:
    """The result of this machine's web processes, at most :data:`KEPT_S` seconds old. All parts fail when none comes
    within :data:`BOUND_S`."""
    global _last
    if not _asking.acquire(timeout=BOUND_S):
        return Readiness({check.name: False for check in checks() if check.name})
    try:
        if _last is None or not _last.is_fresh:
            _last = _look_in_turn()
        return _last
    finally:
        _asking.release()


def look() -> Readiness:
    """Look at everything now. Nothing that is broken raises, and nothing that hangs keeps the caller."""
    began = monotonic()
    figures: Figures = {}
    failed: dict[int, str] = {}
    asked: list[tuple[HealthCheck, threading.Event]] = []
    for number, check in enumerate(checks()):
        failed[number] = f"no answer within {check.deadline_s:g} s"
        ask = partial(_ask, check, figures, failed, number)
        if check.asks_database and connection.in_atomic_block:  # the caller's own rows count, which no thread can see
            ask()
            continue
        if number not in _askers:
            _askers[number] = _Asker(f"health {check.name}")
        if _askers[number].done.is_set():
            asked.append((check, _askers[number].begin(ask)))
    for check, done in asked:
        done.wait(max(0.0, began + check.deadline_s - monotonic()))
    found = Readiness({}, {"streams": None, **figures})
    for number, check in enumerate(checks()):
        why = failed[number]
        if check.name:
            found.parts[check.name] = found.parts.get(check.name, True) and not why
            if why:
                found.reasons.setdefault(check.name, why)
    return replace(found, at=time() - (monotonic() - began))


def _ask(check: HealthCheck, figures: Figures, failed: dict[int, str], number: int) -> None:
    try:
        failed[number] = "" if check.holds(figures) else "not as it should be"
    except FAILS as error:
        failed[number] = next(iter(str(error.__cause__ or error).splitlines()), type(error).__name__)


def _look_in_turn() -> Readiness:
    """Take what another process of this machine has just found, or look and leave it for the others."""
    found = None
    # an OSError of a full disk, for example: then each process looks by itself
    with suppress(OSError), (settings.DATA_DIR / "health.json").open("a+") as file:
        _take_turn(file)
        file.seek(0)
        found = _parse(file.read())
        if found is None or not found.is_fresh:
            found = _logged(look())
            file.truncate(0)
            file.write(json.dumps(asdict(found)))
    return found or _logged(look())


def _logged(found: Readiness) -> Readiness:
    """One line for all parts that fail for the same reason."""
    parts = defaultdict(list)
    for part, why in found.reasons.items():
        parts[why].append(part)
    for why, failed in parts.items():
        log.error("not ready: %s (%s)", ", ".join(failed), why)
    return found


def _take_turn(file: TextIO) -> None:
    """Wait while another process looks, at most until the deadline: that process may have stopped."""
    until = monotonic() + DEADLINE_S + 0.2
    while monotonic() < until:
        try:
            return fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            sleep(0.05)


def _parse(text: str) -> Readiness | None:
    try:
        return Readiness(**json.loads(text))
    except (ValueError, TypeError):  # nothing yet, one that a full disk cut short, or another version's
        return None


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
            cursor.execute(f"SET LOCAL lock_timeout = '{int(WRITE_TIMEOUT_S * 1000)}ms'")
            return bool(rows.filter(pk=first[0]).update(name=first[1]))
    with connection.cursor() as cursor:
        patience = cursor.execute("PRAGMA busy_timeout").fetchone()[0]
        cursor.execute(f"PRAGMA busy_timeout = {int(WRITE_TIMEOUT_S * 1000)}")
        try:
            return bool(rows.filter(pk=first[0]).update(name=first[1]))
        finally:
            cursor.execute(f"PRAGMA busy_timeout = {patience}")


def check_database_pages() -> str:
    """Read all pages of a SQLite database, and keep its damage in SQLite's words for readiness; ``""`` for none."""
    if connection.vendor != "sqlite":
        return ""
    connection.ensure_connection()
    problem = damage(connection.connection)
    caches["default"].set(_DAMAGE, problem, None)
    if problem:
        log.error("The database is damaged: %s. Restore it from a backup: docs/operators.md.", problem)
    return problem


def pages_are_intact() -> bool:
    return not caches["default"].get(_DAMAGE, "")


def _migrations() -> bool:
    return applied_are_all(MigrationRecorder(connection))


def _cache(default: BaseCache) -> bool:
    """Whether the server answers; without it the site goes on (:mod:`config.serving.cache`)."""
    if isinstance(default, SteadyCache):
        return default.answers()
    default.set("health", "1", 10)
    return default.get("health") == "1"


def _broker() -> bool:
    options = {"max_retries": 0, "socket_connect_timeout": BROKER_TIMEOUT_S, "socket_timeout": BROKER_TIMEOUT_S}
    with app.connection_for_write(connect_timeout=BROKER_TIMEOUT_S, transport_options=options) as broker:
        broker.ensure_connection(max_retries=0, timeout=BROKER_TIMEOUT_S)
    return True


def _disk(figures: Figures) -> bool:
    free_mb = shutil.disk_usage(settings.DATA_DIR).free // 2**20
    figures["disk_free_mb"] = free_mb
    return free_mb >= settings.LOW_DISK_MB


def _workers(figures: Figures) -> bool:
    """Whether a worker for evaluations lives and takes work; or none should, because an operator has paused or drained
    them, or all were shut down in good order and nothing waits."""
    now = database_now()
    known = [node for node in WorkerNode.objects.filter(stopped_at=None) if EVALUATIONS.queue in node.queues]
    living = [node for node in known if node.seen_at >= now - SILENT_AFTER]
    held = _held(EVALUATIONS.queue)
    figures["workers"], figures["workers_held"] = len(living), len(held)
    if held or any(not node.refuses for node in living):
        return True
    since = waiting_since()
    return not known and (since is None or now - since < NOBODY_CAME)


def _listens(queue: str) -> bool:
    """Whether a program of this queue lives. None is missed where none was ever seen, or all were shut down in good
    order, until another program has been up for a minute."""
    now = database_now()
    nodes = list(WorkerNode.objects.filter(stopped_at=None))
    living = [node for node in nodes if node.seen_at >= now - SILENT_AFTER]
    if any(queue in node.queues for node in living):
        return True
    if _held(queue):
        return True
    if any(queue in node.queues for node in nodes):
        return False
    return not any(node.started_at and node.started_at < now - NOBODY_CAME for node in living)


def _held(queue: str) -> list[str]:
    """The workers of a queue that an operator has paused or drained."""
    held = holds_by_worker()
    nodes = WorkerNode.objects.filter(name__in=held) if held else ()
    return [node.name for node in nodes if queue in node.queues]


def _streams(figures: Figures) -> bool:
    """No part: without it pages ask by themselves, and a site that is taken out of service for it serves nobody."""
    living = life.last_report()
    figures["streams"] = living["streams"] if living else None
    return True


def _queue(figures: Figures) -> bool:
    since = waiting_since()
    waits_s = 0 if since is None else max(0, int((database_now() - since).total_seconds()))
    figures["oldest_waits_s"] = waits_s
    return waits_s <= settings.QUEUE_ALARM_MINUTES * 60
