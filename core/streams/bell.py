"""Ringing for the stream processes of all machines, through the Redis or Valkey that is the cache.

A ring says "there are new events", and carries nothing: they are read from the table. One that gets lost costs a second
or two, until the stream process looks by itself (:mod:`config.streams.feed`). What is not in the table, a progress or
a message with data, is lost with it: whoever sends one sends another soon, or does not mind.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import Any

from django.conf import settings
from django.db import connection, transaction
from redis import Redis, RedisError
from redis.backoff import NoBackoff
from redis.retry import Retry

logger = logging.getLogger(__name__)
PATIENCE_S = 1.0
LEFT_ALONE_S = 5.0
MOST_BYTES = 16 * 1024
AWAY = (RedisError, OSError)
_server: Redis | None = None
_away_until = 0.0


@dataclass(frozen=True)
class _Ring:
    def __call__(self) -> None:
        _publish(b"{}")


def ring_after_commit() -> None:
    """Ring once when the present transaction is committed, however many events it writes."""
    call = _Ring()
    if all(entry[1] != call for entry in connection.run_on_commit):
        transaction.on_commit(call, robust=True)


def poke(topics: Iterable[str]) -> None:
    """Say now that topics moved by something that is no event: a progress. It may get lost."""
    moved = sorted(topics)
    if moved:
        _publish(json.dumps({"of": moved}).encode())


def poke_after_commit(topics: Iterable[str]) -> None:
    """:func:`poke` once the present transaction is committed."""
    transaction.on_commit(partial(poke, tuple(topics)), robust=True)


def push(topic: str, data: dict[str, Any]) -> bool:
    """Send a message with data to all who follow a topic, now. Whether the server took it; it may get lost all the
    same. Raises ValueError for more than :data:`MOST_BYTES`."""
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
    try:
        if _server is None:
            _server = Redis.from_url(
                settings.STREAM_BELL_URL,
                socket_timeout=PATIENCE_S,
                socket_connect_timeout=PATIENCE_S,
                retry=Retry(NoBackoff(), 1),  # a connection that is kept may have ended with the server before
            )
        _server.publish(channel_of(_server), message)
    except AWAY as error:
        _away_until = monotonic() + LEFT_ALONE_S
        logger.warning("Nobody rings for the streams (%s); they look by themselves.", error or type(error).__name__)
        return False
    return True
