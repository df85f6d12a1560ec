"""The metrics of a scrape: what the processes of this machine have counted, and what the database and the disk have.

The rooms' selectors give the values. A scrape makes a bounded number of queries; while the database is away it has only
the counts and the parts that work.
"""

import shutil
from collections.abc import Iterator
from datetime import datetime
from functools import lru_cache
from time import monotonic
from typing import TYPE_CHECKING

from django.conf import settings
from django.db import DatabaseError, connection, connections

from core import metrics
from core.database.clock import database_now
from core.events.reading import lags
from core.jobs.holds import holds_by_worker
from core.jobs.kinds import all_kinds
from core.jobs.queues import backlog
from core.metrics import Gauge
from core.streams import life
from evaluation.models import StoredFile, WorkerNode
from evaluation.running.heartbeat import SCHEDULER
from evaluation.stored_files import bytes_by_folder
from paddock.simulator.engine import ENGINE_ID
from videos.selectors import bytes_of_videos

from .health import readiness
from .workers import state_at

if TYPE_CHECKING:
    from prometheus_client import CollectorRegistry
    from prometheus_client.core import GaugeMetricFamily

SUMMED_EVERY_S = 60.0  # sums over all files

BUILD = Gauge("paddock_build_info", "1, with the simulator's engine.", ("engine",))
PARTS = Gauge("paddock_part_works", "1 if a part of /health/ready is as it should be, else 0.", ("part",))
JOBS = Gauge(
    "paddock_queue_jobs",
    "Jobs by kind and state: waiting, paused (after a fault of the platform), running.",
    ("kind", "state"),
)
OLDEST = Gauge(
    "paddock_queue_oldest_seconds",
    "How long the first waiting job of a kind has waited; 0 if none waits. Without runs that nobody waits for.",
    ("kind",),
)
BUSY = Gauge("paddock_workers_busy", "Workers that have a job of this kind.", ("kind",))
WORKERS = Gauge(
    "paddock_workers",
    "Workers and schedulers by queue and state: alive, refuses (takes no work), paused, draining, "
    "silent (no heartbeat for a minute).",
    ("queue", "state"),
)
EVENTS = Gauge("paddock_events_unread", "Events that a reader has not handled yet.", ("reader",))
LAG = Gauge(
    "paddock_events_lag_seconds", "Age of the first event that a reader has not handled; 0 if none.", ("reader",)
)
STORED = Gauge("paddock_stored_bytes", "Bytes of stored files, by kind.", ("kind",))
DAMAGED = Gauge("paddock_stored_files_damaged", "Stored files that are missing or altered.")
DATABASE = Gauge("paddock_database_bytes", "Size of the database.")
FREE = Gauge("paddock_disk_free_bytes", "Free space for the data folder.")
DISK = Gauge("paddock_disk_size_bytes", "Size of the disk of the data folder.")
STREAMS = Gauge("paddock_streams_open", "Open streams of the stream process that reported last.")


def registry(*, closes: bool = False) -> "CollectorRegistry":
    """All metrics of this machine, collected by each scrape. ``closes``: the connections to the database, after it."""
    client = metrics.client()
    from prometheus_client.multiprocess import MultiProcessCollector

    settings.METRICS_DIR.mkdir(mode=0o700, exist_ok=True)
    found = client.CollectorRegistry()
    MultiProcessCollector(found, path=str(settings.METRICS_DIR))
    found.register(_Gauges(closes))
    return found


def serve(host: str, port: int) -> None:
    """Answer scrapes on a port until the process ends. Raises OSError where it cannot listen."""
    _server, thread = metrics.client().start_http_server(port, host, registry(closes=True))
    thread.join()


class _Gauges:
    def __init__(self, closes: bool) -> None:
        self._closes = closes

    def collect(self) -> "Iterator[GaugeMetricFamily]":
        try:
            yield from self._collected()
        finally:
            if self._closes:
                connections.close_all()

    def _collected(self) -> "Iterator[GaugeMetricFamily]":
        parts = readiness().parts
        yield _family(BUILD, {(ENGINE_ID,): 1})
        yield _family(PARTS, {(part,): works for part, works in parts.items()})
        disk = shutil.disk_usage(settings.DATA_DIR)
        yield _family(FREE, {(): disk.free})
        yield _family(DISK, {(): disk.total})
        streams = life.last_report()
        yield _family(STREAMS, {(): streams["streams"] if streams else 0})
        if parts.get("database"):
            try:
                yield from list(_of_database(database_now()))
            except DatabaseError:  # it has gone since; the next scrape shows that
                return


def _of_database(now: datetime) -> "Iterator[GaugeMetricFamily]":
    yield from _of_queues(now)
    queues = {SCHEDULER, *(kind.queue for kind in all_kinds())}
    workers: dict[tuple[str, ...], float] = {(queue, "alive"): 0 for queue in sorted(queues)}
    holds = holds_by_worker()
    for node in WorkerNode.objects.filter(stopped_at=None):
        for queue in node.queues:
            key = (queue, state_at(node, holds.get(node.name), now))
            workers[key] = workers.get(key, 0) + 1
    yield _family(WORKERS, workers)
    behind = lags()
    yield _family(EVENTS, {(reader,): lag.events for reader, lag in behind.items()})
    yield _family(LAG, {(reader,): _seconds(lag.since, now) for reader, lag in behind.items()})
    yield _family(DAMAGED, {(): StoredFile.objects.exclude(damage="").count()})
    stored, database = _sums(int(monotonic() / SUMMED_EVERY_S))
    yield _family(STORED, {(kind,): size for kind, size in stored.items()})
    yield _family(DATABASE, {(): database})


def _of_queues(now: datetime) -> "Iterator[GaugeMetricFamily]":
    full = {kind.name.lower(): backlog(kind, now) for kind in all_kinds()}
    states = ("waiting", "paused", "running")
    yield _family(JOBS, {(kind, state): getattr(one, state) for kind, one in full.items() for state in states})
    yield _family(OLDEST, {(kind,): _seconds(one.oldest, now) for kind, one in full.items()})
    yield _family(BUSY, {(kind,): one.workers for kind, one in full.items()})


@lru_cache(maxsize=1)
def _sums(minute: int) -> tuple[dict[str, int], int]:
    """Bytes by folder, and those of the database; read once in :data:`SUMMED_EVERY_S`."""
    return {**bytes_by_folder(), "videos": bytes_of_videos()}, _database_bytes()


def _database_bytes() -> int:
    ask = "SELECT pg_database_size(current_database())"
    if connection.vendor == "sqlite":
        ask = "SELECT page_count * page_size FROM pragma_page_count(), pragma_page_size()"
    with connection.cursor() as cursor:
        cursor.execute(ask)
        return int(cursor.fetchone()[0])


def _seconds(since: datetime | None, now: datetime) -> float:
    return 0.0 if since is None else max(0.0, (now - since).total_seconds())


def _family(gauge: Gauge, values: dict[tuple[str, ...], float]) -> "GaugeMetricFamily":
    family = gauge.family()
    for labels, value in values.items():
        family.add_metric(labels, float(value))
    return family
