"""What is made from the database once and given to all who ask, as long as nothing was committed since."""

from __future__ import annotations

import sqlite3
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from django.db import connection

T = TypeVar("T")


@dataclass
class _Kept(Generic[T]):
    """A value, and when it was begun: at which version of the database, at which time of the process's clock."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    version: object = None
    number: int = -1
    begun_at: float = 0.0
    value: T | None = None


class Unchanged(Generic[T]):
    """Values by their keys, in the memory of this process.

    A value is given to whoever asked before it was begun, and to others while nothing at all has been committed since
    then and it is at most ``lives_s`` seconds old: nobody gets what is older than their question. Many who ask at once
    for what has to be made wait for the first of them, who makes it; so a database that is written to all the time
    costs one making after the other, and not one for each who asks. Of ``size`` values the one asked for longest ago
    makes way.
    """

    def __init__(self, size: int) -> None:
        self._size = size
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
        """The value of ``key``. ``make`` gives a new one, and whether others may have it too.

        ``number``: of the last thing that happened, as far as who asks was told; they are content with a value that
        is young enough and was begun when ``newest()`` was as much, whatever else has been committed since.

        Not inside of a transaction: what it sees is its own (see :func:`is_shared`).
        """
        asked_at = time.monotonic()
        kept = self._of(key)
        with kept.lock:
            is_young = time.monotonic() - kept.begun_at <= lives_s
            if number is not None and kept.version is not None and is_young and kept.number >= number:
                return kept.value  # type: ignore[return-value]
            version = database_version()
            is_new = kept.begun_at >= asked_at or (kept.version == version and is_young)
            if kept.version is not None and is_new:
                return kept.value  # type: ignore[return-value]
            kept.version = kept.value = None
            begun_at = time.monotonic()
            kept.number = newest() if newest is not None else -1
            value, for_all = make()
            if for_all:
                kept.version, kept.begun_at, kept.value = version, begun_at, value
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
    """What is the same exactly as long as nobody commits anything.

    SQLite counts the commits of all other connections (``data_version``), so one of our own asks that never writes;
    PostgreSQL's snapshot names the transactions that a reader sees.
    """
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
