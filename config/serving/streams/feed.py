"""Reads new events from the table, whenever the bell rings."""

import asyncio
import json
import logging
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from django.conf import settings
from django.db import Error, connections
from redis import RedisError
from redis.asyncio import Redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff

from core.wakeups.streams import channel_of

logger = logging.getLogger(__name__)
T = TypeVar("T")
AWAY = (RedisError, OSError, asyncio.TimeoutError)
AGAIN_S, AGAIN_MOST_S = 0.5, 5.0
ASKED_S = 20.0  # a silent server is pinged


class Desk:
    """Threads that ask the database, each with a connection of its own that stays open."""

    def __init__(self, name: str, threads: int) -> None:
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix=name)

    async def ask(self, question: Callable[..., T], *arguments: Any) -> T:
        """What ``question(*arguments)`` answers. Raises what it raises; after a fault of the database the next
        question has a new connection."""
        return await asyncio.get_running_loop().run_in_executor(self._pool, _asked, question, arguments)

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)


def _asked(question: Callable[..., T], arguments: tuple[Any, ...]) -> T:
    try:
        return question(*arguments)
    except Error:
        connections.close_all()
        raise


class Bell:
    """Listens to the bell for as long as it runs. ``rang()``: there are events; ``received(message)``: what is in no
    table. ``is_heard``: whether it listens just now."""

    def __init__(self, rang: Callable[[], None], received: Callable[[Mapping[str, object]], None]) -> None:
        self._rang, self._received = rang, received
        self.is_heard = False

    async def listen(self) -> None:
        """Listen until cancelled, and reconnect to a server that is away."""
        if not settings.STREAM_BELL_URL:
            return
        pause = AGAIN_S
        while True:
            server = Redis.from_url(settings.STREAM_BELL_URL, socket_connect_timeout=2.0, retry=Retry(NoBackoff(), 0))
            try:
                async with server, server.pubsub(ignore_subscribe_messages=True) as heard:
                    await heard.subscribe(channel_of(server))
                    self._note(True)
                    pause = AGAIN_S
                    self._rang()  # for what was rung while nobody listened
                    await self._hear(heard)
            except AWAY as error:
                self._note(False, error)
            await asyncio.sleep(pause)
            pause = min(2 * pause, AGAIN_MOST_S)

    async def _hear(self, heard: Any) -> None:
        asked = False
        while True:
            sent = await heard.get_message(timeout=ASKED_S)
            if sent is None:
                if asked:
                    raise TimeoutError("no answer")
                await heard.ping()
                asked = True
                continue
            asked = False
            if sent["type"] == "message":
                self._take(sent["data"])

    def _take(self, data: bytes) -> None:
        try:
            message = json.loads(data)
        except ValueError:
            return  # not ours
        if message:
            self._received(message)
        else:
            self._rang()

    def _note(self, is_heard: bool, error: BaseException | None = None) -> None:
        if self.is_heard and not is_heard:
            logger.warning("The bell of the streams is away (%s): the table is looked at every second.", error)
        self.is_heard = is_heard
