"""Wake-ups and messages for the stream processes of all machines, through Redis or Valkey.

A ring carries no data: events are read from the table, at the latest by the next poll. A lost message is not repeated.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable
from time import monotonic
from typing import TYPE_CHECKING, Any

from django.conf import settings
from django.db import connection, transaction

from core.database.after_commit import after_commit

if TYPE_CHECKING:
    from redis import Redis

logger = logging.getLogger(__name__)
PATIENCE_S = 1.0
LEFT_ALONE_S = 5.0
MOST_BYTES = 16 * 1024
_server: Redis | None = None
_away_until = 0.0


def _ring() -> None:
    _publish(b"{}")


def ring_after_commit() -> None:
    """Ring once when the present transaction is committed, however many events it writes."""
    if all(entry[1] is not _ring for entry in connection.run_on_commit):
        transaction.on_commit(_ring, robust=True)


def poke(topics: Iterable[str]) -> None:
    """Announce that topics moved without an event; it may get lost."""
    moved = sorted(topics)
    if moved:
        _publish(json.dumps({"of": moved}).encode())


def poke_after_commit(topics: Iterable[str]) -> None:
    """:func:`poke` once the present transaction is committed."""
    after_commit(poke, tuple(topics))


def push(topic: str, data: dict[str, object]) -> bool:
    """Send a message to all followers of a topic. Returns whether the server took it. Raises ValueError above
    :data:`MOST_BYTES`."""
    message = json.dumps({"to": topic, "data": data}, separators=(",", ":")).encode()
    if len(message) > MOST_BYTES:
        raise ValueError(f"a message of {len(message)} bytes is too large")
    return _publish(message)


def channel_of(server: Any) -> str:
    """The channel of this site: one server may serve several sites, each with a database of its number."""
    return f"paddock.{server.connection_pool.connection_kwargs.get('db', 0)}.stream"


def _publish(message: bytes) -> bool:
    global _server, _away_until
    if not settings.STREAM_BELL_URL or monotonic() < _away_until:
        return False
    from redis import Redis, RedisError  # an eighth of a second, and most commands ring nobody
    from redis.backoff import NoBackoff
    from redis.retry import Retry

    try:
        if _server is None:
            _server = Redis.from_url(
                settings.STREAM_BELL_URL,
                socket_timeout=PATIENCE_S,
                socket_connect_timeout=PATIENCE_S,
                retry=Retry(NoBackoff(), 1),  # a connection that is kept may have ended with the server before
            )
        _server.publish(channel_of(_server), message)
    except (RedisError, OSError) as error:
        _away_until = monotonic() + LEFT_ALONE_S
        logger.warning("Nobody rings for the streams (%s); they look by themselves.", error or type(error).__name__)
        return False
    return True
