"""The site's cache: Redis or Valkey, and while that is away, each process's own memory.

What is kept there are counts of attempts, short locks and pictures. So nothing but these depends on it: limits hold on
while it is away, by process instead of for the site, and what was counted before is forgotten.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from time import monotonic
from typing import Any

from django.core.cache.backends.base import BaseCache
from django.core.cache.backends.locmem import LocMemCache
from django.core.cache.backends.redis import RedisCache
from redis import RedisError

logger = logging.getLogger(__name__)
AWAY_S = 5.0  # not asked again for so long: who does not answer at all would keep every request waiting
AWAY = (RedisError, OSError)


class _Health:
    """What a process knows of a server: each of its threads has a cache of its own."""

    def __init__(self) -> None:
        self.away_until = 0.0
        self._is_away = False
        self._lock = threading.Lock()

    def note_away(self) -> bool:
        """It did not answer. Whether that is news."""
        with self._lock:
            self.away_until = monotonic() + AWAY_S
            news, self._is_away = not self._is_away, True
            return news

    def note_back(self) -> bool:
        """It answered. Whether that is news."""
        if not self._is_away:
            return False
        with self._lock:
            news, self._is_away = self._is_away, False
            return news


_HEALTH: dict[str, _Health] = {}
_known = threading.Lock()


class SteadyCache(BaseCache):
    """A cache that answers whatever becomes of the server at ``LOCATION``."""

    def __init__(self, server: str | list[str], params: dict[str, Any]) -> None:
        super().__init__(params)
        self._server = RedisCache(server, params)
        self._own = LocMemCache(f"{__name__} {server}", params)
        with _known:
            self._health = _HEALTH.setdefault(str(server), _Health())

    def answers(self) -> bool:
        """Whether the server itself keeps what it is given."""
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
                return answer
        return getattr(self._own, name)(*arguments, **options)


def _asking(name: str) -> Callable[..., Any]:
    def ask(self: SteadyCache, *arguments: Any, **options: Any) -> Any:
        return self._ask(name, *arguments, **options)

    ask.__name__, ask.__doc__ = name, getattr(BaseCache, name).__doc__
    return ask


# all that Django's cache for Redis does in its own way; the rest is made of these
for _name in (
    "add",
    "get",
    "set",
    "touch",
    "delete",
    "get_many",
    "has_key",
    "incr",
    "set_many",
    "delete_many",
    "clear",
):
    setattr(SteadyCache, _name, _asking(_name))
