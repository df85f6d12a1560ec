"""The status of the stream process, kept in the cache, for the health page, ``doctor`` and live events."""

from datetime import datetime
from typing import TypedDict

from django.core.cache import cache

from ..database.clock import database_now

KEY = "streams"
REPORTED_EVERY_S = 2.0
LIVES_S = 35  # without another sign
FRESH_S = 4.0  # a sign of a process that lives now is no older
_process: dict[str, float] = {}


class StreamFigures(TypedDict):
    """The figures of a stream process (:meth:`config.serving.streams.hub.Hub.figures`)."""

    streams: int  # open
    position: int | None
    bell: bool  # connected
    memory_mb: int  # peak
    processor_s: float


class StreamStatus(StreamFigures):
    began: float  # Unix seconds of the database's clock
    at: float


def report(figures: StreamFigures) -> None:
    """Store the figures as the latest status."""
    now = database_now().timestamp()
    began = _process.setdefault("began", now)
    cache.set(KEY, StreamStatus(**figures, began=began, at=now), LIVES_S)


def last_report() -> StreamStatus | None:
    """The latest status, or None without a running stream process."""
    return cache.get(KEY)


def lived_through(since: datetime, now: datetime) -> bool:
    """Whether one stream process has lived from ``since`` until ``now``, by the database's clock."""
    sign = last_report()
    return sign is not None and sign["began"] <= since.timestamp() and sign["at"] >= now.timestamp() - FRESH_S
