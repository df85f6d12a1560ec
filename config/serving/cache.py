"""Caches in Redis or Valkey, and in each process's own memory while the server is away.

Meanwhile rate limits hold per process instead of per site, and earlier counts are lost.
"""

import logging
import threading
from collections.abc import Callable
from time import monotonic
from typing import Any

from django.core.cache.backends.base import BaseCache
from django.core.cache.backends.locmem import LocMemCache
from django.core.cache.backends.redis import RedisCache
from redis import RedisError

from core.database.commit_cache import READS

logger = logging.getLogger(__name__)
AWAY_S = 5.0  # until the next try: a server that hangs would delay every request
AWAY = (RedisError, OSError)


class _Health:
    """What a process knows of a server: each of its threads has a cache of its own."""

    def __init__(self) -> None:
        self.away_until = 0.0
        self._is_away = False
        self._lock = threading.Lock()

    def note_away(self) -> bool:
        """Note that the server does not answer. Whether that is new."""
        with self._lock:
            self.away_until = monotonic() + AWAY_S
            news, self._is_away = not self._is_away, True
            return news

    def note_back(self) -> bool:
        """Note that the server answers. Whether that is new."""
        if not self._is_away:
            return False
        with self._lock:
            news, self._is_away = self._is_away, False
            return news


_HEALTH: dict[str, _Health] = {}
_known = threading.Lock()


class SteadyCache(BaseCache):
    """A cache that works without the server at ``LOCATION``."""

    def __init__(self, server: str | list[str], params: dict[str, object]) -> None:
        super().__init__(params)
        self._server = RedisCache(server, params)
        self._own = LocMemCache(f"{__name__} {server}", params)
        with _known:
            self._health = _HEALTH.setdefault(str(server), _Health())

    def answers(self) -> bool:
        """Whether the server itself stores values."""
        try:
            self._server.set("answers", "1", 10)
            return self._server.get("answers") == "1"
        except AWAY:
            return False

    def _ask(self, name: str, *arguments: Any, **options: Any) -> Any:
        if monotonic() >= self._health.away_until:
            try:
                answer = getattr(self._server, name)(*arguments, **options)
            except AWAY as error:
                if self._health.note_away():
                    logger.error("The cache does not answer (%s): this process keeps what it must itself.", error)
            else:
                if self._health.note_back():
                    self._own.clear()
                    logger.warning("The cache answers again.")
                if name == "get":
                    default = arguments[1] if len(arguments) > 1 else options.get("default")
                    READS.inc("server", "miss" if answer is default else "hit")
                return answer
        return getattr(self._own, name)(*arguments, **options)


def _asking(name: str) -> Callable[..., Any]:
    def ask(self: SteadyCache, *arguments: Any, **options: Any) -> Any:
        return self._ask(name, *arguments, **options)

    ask.__name__, ask.__doc__ = name, getattr(BaseCache, name).__doc__
    return ask


# all that Django's cache for Redis does in its own way; the rest is made of these
for _name in (
    *("add", "get", "set", "touch", "delete", "has_key", "incr", "clear"),
    *("get_many", "set_many", "delete_many"),
):
    setattr(SteadyCache, _name, _asking(_name))
