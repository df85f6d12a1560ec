"""A thread that renews a lease while a job runs."""

import logging
import threading
from collections.abc import Callable
from contextvars import copy_context
from datetime import timedelta
from time import monotonic
from typing import Any, Self

from django.db import connections

logger = logging.getLogger(__name__)
BEATS_PER_LEASE = 6


class Heartbeat(threading.Thread):
    """Renews a lease and writes the progress while its block runs.

    ``beat(progress or None)`` renews the lease and returns whether it is valid: at most every ``every_s`` seconds, at
    least :data:`BEATS_PER_LEASE` times per lease, with ``always`` without progress too. ``lost``: the lease is gone, or
    the database was away for its length."""

    def __init__(
        self,
        name: str,
        beat: Callable[[Any | None], bool],
        *,
        lease: timedelta,
        every_s: float = 1.0,
        always: bool = False,
    ) -> None:
        super().__init__(name=f"heartbeat of {name}", daemon=True)
        self._beat = beat
        self._lease_s = lease.total_seconds()
        self._idle_s = self._lease_s / BEATS_PER_LEASE
        self._every_s = min(every_s, self._idle_s)
        self._always = always
        self._ended = threading.Event()
        self._news: Any | None = None
        self.lost = False
        self._context = copy_context()  # its lines in the log have the ids of its job

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._ended.set()
        self.join()

    def tell(self, progress: Any) -> None:
        """Take the newest progress; the next beat writes it."""
        self._news = progress

    def run(self) -> None:
        self._context.run(self._beat_on)

    def _beat_on(self) -> None:
        last = monotonic()
        try:
            while not self._ended.wait(self._every_s) and not self.lost:
                news = self._news
                if news is None and not self._always and monotonic() - last < self._idle_s:
                    continue
                try:
                    self.lost = not self._beat(news)
                except Exception as error:  # the database may be away in many ways
                    logger.warning("A heartbeat could not be written", exc_info=error)
                    connections.close_all()
                    self.lost = monotonic() - last > self._lease_s
                else:
                    last = monotonic()
                    if self._news is news:
                        self._news = None
        finally:
            connections.close_all()
