"""Log filters that remove the tracebacks of refused requests and outages."""

import logging
import sqlite3
import threading
import time

from django.db import InterfaceError, OperationalError

from ..files.storage_faults import is_outage_of_storage

QUIET_S = 60.0  # seconds between two lines about the same outage
# Primary result codes of SQLite (sqlite.org/rescode.html) that are a state of file or disk, not a mistake in a query
_SQLITE_OUTAGES = frozenset((3, 5, 6, 7, 8, 10, 11, 13, 14, 15, 26))


class WithoutRefusalTraces(logging.Filter):
    """A filter of log records: a refused request (4xx) is one line without a traceback."""

    def filter(self, record: logging.LogRecord) -> bool:
        if 400 <= getattr(record, "status_code", 0) < 500:
            record.exc_info = record.exc_text = None
        return True


class Outages(logging.Filter):
    """A log filter: an outage of database, broker or storage is one line a minute instead of a traceback each time."""

    def __init__(self, name: str = "") -> None:
        super().__init__(name)
        self._lock = threading.Lock()
        self._written_at: dict[str, float] = {}
        self._suppressed: dict[str, int] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        kind = None if error is None else outage_of(error)
        if error is None or kind is None:
            return True
        with self._lock:
            now = time.monotonic()
            if now - self._written_at.get(kind, -QUIET_S) < QUIET_S:
                self._suppressed[kind] = self._suppressed.get(kind, 0) + 1
                return False
            self._written_at[kind], more = now, self._suppressed.pop(kind, 0)
        message = record.getMessage().strip().partition("\n")[0].rstrip(".: ")
        cause = (str(error.__cause__ or error) or type(error).__name__).strip().replace("\n", " ")
        count = f" ({more} more since the last line)" if more else ""
        record.msg, record.args = f"The {kind} does not answer: {cause}{count}. First seen: {message}.", ()
        record.exc_info = record.exc_text = record.stack_info = None
        return True


def outage_of(error: BaseException) -> str | None:
    """What is out, if this is what made the error: database, broker or storage."""
    if is_outage_of_database(error):
        return "database"
    from kombu.exceptions import OperationalError as BrokerError  # a tenth of a second, for a process without errors
    from redis import RedisError

    if isinstance(error, (RedisError, BrokerError)):
        return "broker or cache"
    return "storage of files" if is_outage_of_storage(error) else None


def is_outage_of_database(error: BaseException) -> bool:
    """Whether the database does not answer now, as opposed to a query that is wrong."""
    if not isinstance(error, (OperationalError, InterfaceError, sqlite3.OperationalError)):
        return False
    code = getattr(error.__cause__ or error, "sqlite_errorcode", None)
    return code is None or code & 0xFF in _SQLITE_OUTAGES
