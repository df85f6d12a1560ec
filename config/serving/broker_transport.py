"""Celery's transport for Redis and Valkey, for messages that only wake workers.

A list keeps its :data:`LONGEST` newest messages. Returning a message on a closed connection raises the client's own
error, which Celery expects: Kombu's AttributeError would end the worker.
"""

from typing import Any

from kombu.transport import TRANSPORT_ALIASES, redis
from redis import ConnectionError as Disconnected

LONGEST = 1000


class _WakeUps:
    """The behaviour of both transports' channels."""

    def _put(self, queue: str, message: dict[str, object], **options: Any) -> None:
        super()._put(queue, message, **options)  # type: ignore[misc]
        key = self._q_for_pri(queue, self._get_message_priority(message, reverse=False))  # type: ignore[attr-defined]
        with self.conn_or_acquire() as client:  # type: ignore[attr-defined]
            client.ltrim(key, 0, LONGEST - 1)

    def _connparams(self, asynchronous: bool = False) -> dict[str, object]:
        if getattr(self.connection, "client", None) is None:  # type: ignore[attr-defined]
            raise Disconnected("The connection of this channel has ended.")
        return super()._connparams(asynchronous=asynchronous)  # type: ignore[misc]


class WakeUpChannel(_WakeUps, redis.Channel):
    """A channel to one server."""


class SentinelChannel(_WakeUps, redis.SentinelChannel):
    """A channel to the server that sentinels name."""


class Transport(redis.Transport):
    Channel = WakeUpChannel


class SentinelTransport(redis.SentinelTransport):
    Channel = SentinelChannel


def use() -> None:
    TRANSPORT_ALIASES.update(
        redis=f"{__name__}:Transport", rediss=f"{__name__}:Transport", sentinel=f"{__name__}:SentinelTransport"
    )
