"""A cache of values that is valid until the next commit to the database."""

import sqlite3
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from django.db import connection

from ..metrics import Counter

T = TypeVar("T")

READS = Counter(
    "paddock_cache_reads_total",
    "Reads of caches, by cache (pages and parts: in a web process; server: Redis or Valkey) and result (hit, miss).",
    ("cache", "result"),
)
MAKING_SHARE, SLOW_S = 4, 10.0  # a value that was slow to make lives so many times as long, up to so many seconds


@dataclass
class _Kept(Generic[T]):
    """A value, and when it was begun: at which version of the database, at which time of the process's clock."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    version: object = None
    number: int = -1
    begun_at: float = 0.0
    took_s: float = 0.0
    value: T | None = None


class Unchanged(Generic[T]):
    """Values by key in this process's memory, of which the least recently used beyond ``size`` are dropped.
    ``name``: in metrics.

    No value is older than the call that gets it, unless nothing was committed since (for ``lives_s`` seconds, or longer
    if it was slow to make). Concurrent calls for a missing value wait for the first one."""

    def __init__(self, size: int, name: str = "parts") -> None:
        self._size, self._name = size, name
        self._kept: OrderedDict[Hashable, _Kept[T]] = OrderedDict()
        self._lock = threading.Lock()

    def get(
        self,
        key: Hashable,
        lives_s: float,
        make: Callable[[], tuple[T, bool]],
        *,
        number: int | None = None,
        newest: Callable[[], int] | None = None,
    ) -> T:
        """The value of ``key``. ``make`` returns a new one, and whether it may be shared. Not for use inside a
        transaction.

        ``number``: the last event that the caller has seen; then a young value made at ``newest() >= number`` will do.
        """
        asked_at = time.monotonic()
        kept = self._of(key)
        with kept.lock:
            # one that takes long to make, on a busy machine, would be old when it is done, and made for each caller
            is_young = time.monotonic() - kept.begun_at <= max(lives_s, min(MAKING_SHARE * kept.took_s, SLOW_S))
            if number is not None and kept.version is not None and is_young and kept.number >= number:
                READS.inc(self._name, "hit")
                return kept.value  # type: ignore[return-value]
            version = database_version()
            is_new = kept.begun_at >= asked_at or (kept.version == version and is_young)
            if kept.version is not None and is_new:
                READS.inc(self._name, "hit")
                return kept.value  # type: ignore[return-value]
            READS.inc(self._name, "miss")
            kept.version = kept.value = None
            begun_at = time.monotonic()
            kept.number = newest() if newest is not None else -1
            value, for_all = make()
            if for_all:
                kept.version, kept.begun_at, kept.value = version, begun_at, value
                kept.took_s = time.monotonic() - begun_at
            return value

    def _of(self, key: Hashable) -> _Kept[T]:
        with self._lock:
            kept = self._kept.setdefault(key, _Kept())
            self._kept.move_to_end(key)
            while len(self._kept) > self._size:
                self._kept.popitem(last=False)
        return kept


def is_shared() -> bool:
    """Whether what this connection reads is what everybody reads: a transaction sees changes of its own."""
    return not connection.in_atomic_block


def database_version() -> object:
    """A value that changes with every commit: SQLite's ``data_version`` on a connection that never writes, PostgreSQL's
    snapshot."""
    if connection.vendor == "sqlite":
        return _sqlite_version(str(connection.settings_dict["NAME"]))
    with connection.cursor() as cursor:
        cursor.execute("SELECT pg_current_snapshot()::text")
        return cursor.fetchone()[0]


_watching: dict[str, sqlite3.Connection] = {}
_watch = threading.Lock()


def _sqlite_version(path: str) -> tuple[str, int]:
    with _watch:
        if path not in _watching:
            _watching[path] = sqlite3.connect(f"file:{path}?mode=ro", uri=True, check_same_thread=False, timeout=20)
        return path, _watching[path].execute("PRAGMA data_version").fetchone()[0]
