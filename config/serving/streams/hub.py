"""Sends each reader the messages of its topics.

Everything runs in one thread; only the desks wait for the database. Events go out in the order of their positions. The
access of a reader is checked with each message.
"""

from __future__ import annotations

import asyncio
import logging
import resource
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import aclosing, suppress
from time import monotonic
from typing import Any, TypeAlias

from django.db import Error

from core.metrics import Counter
from core.streams import TOPICS, Backstage, life
from core.streams.reading import AT_ONCE, Moved, after, between, newest

from .feed import Bell, Desk
from .reader import NUMBERS_SENT, Reader, data_message, message
from .viewers import allowed, viewers_of

logger = logging.getLogger(__name__)
LOOK_S = 1.0  # how long a ring that got lost delays what it rang for
BEAT_S = 20.0
CHECK_S = 10.0  # how long a stream without news may outlive its session
TRUSTED_S = 2.0  # for how long an answer holds for messages that come many times a second
SPREAD_MS_EACH, SPREAD_MOST_MS = 3, 3000  # at most 170 pages a second, for each waits twice that (live-page.js)
AGAIN_S = 2.0
WELCOMES_S = 1.0  # how long the welcome of a topic is reused while there is no new message
GONE = message({}, event="gone")
OPENED = Counter("paddock_streams_opened_total", "Streams that were opened.")
Source: TypeAlias = Callable[[str, Backstage], AsyncIterator[Any]]


class Hub:
    def __init__(self) -> None:
        self.readers: set[Reader] = set()
        self.position: int | None = None  # None: nothing was read yet
        self.bell = Bell(self._ring, self._receive)
        self._by_topic: dict[str, set[Reader]] = defaultdict(set)
        self._table = Desk("table", 1)
        self._people = Desk("people", 2)
        self._rang = asyncio.Event()
        self._sources: dict[str, asyncio.Task[None]] = {}
        self._stages: dict[str, _Backstage] = {}
        self._welcome: dict[str, tuple[asyncio.Task[Any], float]] = {}
        self._trusted: dict[tuple[str, str], tuple[bool, float]] = {}
        self._tasks: list[asyncio.Task[Any]] = []
        self._asides: set[asyncio.Task[Any]] = set()

    def start(self) -> None:
        work = (self.bell.listen(), self._follow(), self._beat(), self._check(), self._live())
        self._tasks = [asyncio.create_task(each) for each in work]

    async def close(self) -> None:
        """End all streams; their readers reconnect to the next process."""
        for task in (*self._tasks, *self._sources.values(), *self._asides):
            task.cancel()
        for reader in list(self.readers):
            reader.end()
        self._table.close()
        self._people.close()

    # --- readers ------------------------------------------------------------------------------------------------------
    async def come(self, reader: Reader, last: int | None) -> None:
        """Add a reader that is up to date with ``last`` (None: with now). Raises the database's errors."""
        self.readers.add(reader)
        OPENED.inc()
        for topic in reader.topics:
            self._by_topic[topic].add(reader)
        while self.position is None:
            self.position = await self._table.ask(newest)
        begins = reader.position = self.position
        reader.may = (await self._may(reader.topics, [reader]))[reader] if reader.topics else set()
        past = await self._past_of(reader, last, begins) if last is not None and last != begins else []
        welcomes = await self._welcomes(reader)
        # its position comes after all that is up to it: cut in between, the reader asks for the rest
        hello = b"retry: 2000\n" + message({"spread": self.spread_ms}, event="hello", position=begins)
        reader.tell_past([*past, *welcomes, hello])

    def leave(self, reader: Reader) -> None:
        self.readers.discard(reader)
        for topic in reader.topics:
            following = self._by_topic[topic]
            following.discard(reader)
            if not following:
                del self._by_topic[topic]
                self._welcome.pop(topic, None)
                if topic in self._sources:
                    self._sources.pop(topic).cancel()
                    del self._stages[topic]

    @property
    def spread_ms(self) -> int:
        """Over how long readers spread what they ask for when the same moves for all of them."""
        return min(SPREAD_MS_EACH * len(self.readers), SPREAD_MOST_MS)

    async def _past_of(self, reader: Reader, last: int, begins: int) -> list[bytes]:
        past = await self._table.ask(between, last, begins)
        if past is None:
            return [message({}, event="reload")]
        topics = {topic for moved in past for topic in moved.topics} & reader.topics
        visible = topics & reader.may
        numbers = [moved.position for moved in past if moved.topics & visible]
        return [message({"of": sorted(visible), "at": numbers[-NUMBERS_SENT:]})] if visible else []

    async def _welcomes(self, reader: Reader) -> list[bytes]:
        """The messages of topics for a reader that has just joined; their sources begin."""
        special = {topic for topic in reader.topics if (kind := _kind(topic)) and (kind.welcome or kind.source)}
        welcomes = []
        for topic in sorted(special & reader.may):
            kind = TOPICS[topic.partition(":")[0]]
            if kind.welcome is not None and (welcome := await self._welcome_to(topic, kind.welcome)):
                welcomes.append(welcome)
            if kind.source is not None and topic not in self._sources and not reader.is_over:
                self._stages[topic] = _Backstage(self._people)
                self._sources[topic] = asyncio.create_task(self._play(topic, kind.source, self._stages[topic]))
        return welcomes

    async def _welcome_to(self, topic: str, made_by: Any) -> bytes:
        """The message, made once for all readers that join at about the same time; empty for none."""
        made, at = self._welcome.get(topic, (None, 0.0))
        if made is None or monotonic() - at > WELCOMES_S:
            made = asyncio.create_task(self._made(topic, made_by))
            self._welcome[topic] = made, monotonic()
        try:
            return await asyncio.shield(made)
        except Error:
            self._welcome.pop(topic, None)
            raise
        except Exception:  # of a room's own: the stream goes on without it
            self._welcome.pop(topic, None)
            logger.exception("The welcome of %s failed", topic)
            return b""

    async def _made(self, topic: str, made_by: Any) -> bytes:
        data = await self._people.ask(made_by, topic.partition(":")[2])
        return b"" if data is None else data_message(topic, data)

    # --- messages ---------------------------------------------------------------------------------------------------
    def _ring(self) -> None:
        self._rang.set()
        for stage in self._stages.values():  # they look for themselves, while the events are numbered
            stage.moved.set()

    async def _follow(self) -> None:
        """Read what happened, and tell it: when the bell rings, and now and then without."""
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._rang.wait(), LOOK_S)
            self._rang.clear()
            try:
                await self._read_on()
            except Error as error:
                logger.warning("The streams cannot read the events", exc_info=error)
                await asyncio.sleep(AGAIN_S)
            except Exception:  # of a room's own: the others' topics go on
                logger.exception("The streams could not tell what happened")
                await asyncio.sleep(AGAIN_S)

    async def _read_on(self) -> None:
        if self.position is None:
            self.position = await self._table.ask(newest)
        while True:
            last, events = await self._table.ask(after, self.position)
            if last < self.position:
                for reader in list(self.readers):
                    reader.tell(message({}, event="reload", position=last))
            # at once: a reader that joins meanwhile gets these as the past
            before, self.position = self.position, last
            try:
                await self._tell(events, last)
            except BaseException:
                self.position = before
                raise
            if len(events) < AT_ONCE:
                return

    async def _tell(self, events: list[Moved], last: int) -> None:
        heard: dict[Reader, set[str]] = defaultdict(set)
        for topic in {topic for moved in events for topic in moved.topics}:
            self._wake(topic)
            for reader in self._by_topic.get(topic, ()):
                heard[reader].add(topic)
        may = await self._may({topic for topics in heard.values() for topic in topics}, heard) if heard else {}
        numbers: dict[frozenset[str], list[int]] = {}
        for reader, topics in may.items():
            # a reader that lost access gets a last message: the page reloads, and is refused
            sent = frozenset(heard[reader] & (topics | reader.may))
            reader.may = (reader.may - heard[reader]) | (topics & heard[reader])
            if sent not in numbers:
                numbers[sent] = [moved.position for moved in events if moved.topics & sent]
            if sent:
                reader.tell_moves(numbers[sent], sent, last)
        # readers without a message are up to date all the same
        for reader in self.readers:
            reader.position = max(reader.position, last)

    async def _may(self, topics: Iterable[str], readers: Iterable[Reader]) -> dict[Reader, set[str]]:
        """The topics that each of the readers may follow now. A session that is over ends its
        streams."""
        readers = list(readers)
        wanted = set(topics)
        sessions: dict[str, set[str]] = defaultdict(set)
        for reader in readers:
            if reader.session:
                sessions[reader.session] |= reader.topics & wanted
        everybody, each, over = await self._people.ask(allowed, wanted, dict(sessions))
        self._end(over)
        return {reader: (everybody | each.get(reader.session, set())) & reader.topics for reader in readers}

    def _end(self, sessions: set[str]) -> None:
        for reader in [reader for reader in self.readers if reader.session in sessions] if sessions else ():
            reader.end(GONE)

    # --- what is in no table ------------------------------------------------------------------------------------------
    def _receive(self, sent: Mapping[str, object]) -> None:
        """Something came by the bell: topics that moved without an event, or a message for those of one topic."""
        to, of = sent.get("to"), sent.get("of")
        if isinstance(to, str):
            self._welcome.pop(to, None)
            self._aside(self._send(to, data_message(to, sent.get("data"))))
        elif isinstance(of, list):
            for topic in of:
                self._wake(topic)
                self._aside(self._send(topic, message({"of": [topic]})))

    def _wake(self, topic: str) -> None:
        if topic in self._stages:
            self._stages[topic].moved.set()

    def _aside(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._asides.add(task)
        task.add_done_callback(self._asides.discard)

    async def _play(self, topic: str, source: Source, stage: _Backstage) -> None:
        key = topic.partition(":")[2]
        while True:
            try:
                async with aclosing(source(key, stage)) as messages:  # type: ignore[type-var]
                    async for data in messages:
                        self._welcome.pop(topic, None)  # readers that join from now on get the new one
                        await self._send(topic, data_message(topic, data))
                return
            except Error as error:
                logger.warning("The source of %s cannot ask the database", topic, exc_info=error)
            except Exception:  # of a room's own: the stream goes on without it
                logger.exception("The source of %s failed", topic)
            await asyncio.sleep(AGAIN_S)

    async def _send(self, topic: str, sent: bytes) -> None:
        """Send a message to the readers that follow a topic and may, as known at most :data:`TRUSTED_S` ago."""
        now = monotonic()
        following = list(self._by_topic.get(topic, ()))
        unknown = [reader for reader in following if self._trusted.get((topic, reader.session), (0, 0.0))[1] < now]
        if unknown:
            with suppress(Error):  # a reader whose access cannot be checked gets nothing
                for reader, may in (await self._may({topic}, unknown)).items():
                    self._trusted[topic, reader.session] = bool(may), now + TRUSTED_S
        for reader in following:
            if self._trusted.get((topic, reader.session), (False, 0.0))[0] and not reader.is_over:
                reader.tell(sent)

    # --- time ---------------------------------------------------------------------------------------------------------
    async def _beat(self) -> None:
        """A heartbeat for readers without recent messages. It carries the position, so that after a
        reconnection only new messages follow."""
        while True:
            await asyncio.sleep(1.0)
            now, spread = monotonic(), {"spread": self.spread_ms}
            sent: dict[int, bytes] = {}
            for reader in list(self.readers):
                if now - reader.sent_at >= BEAT_S:
                    if reader.position not in sent:
                        sent[reader.position] = message(spread, event="beat", position=reader.position)
                    reader.tell(sent[reader.position])

    def figures(self) -> life.StreamFigures:
        """The status of this process."""
        used = resource.getrusage(resource.RUSAGE_SELF)
        return {
            "streams": len(self.readers),
            "position": self.position,
            "bell": self.bell.is_heard,
            "memory_mb": used.ru_maxrss // 1024,
            "processor_s": round(used.ru_utime + used.ru_stime, 1),
        }

    async def _live(self) -> None:
        """Report the figures now and then."""
        while True:
            with suppress(Error):  # the database is away
                await self._people.ask(life.report, self.figures())
            await asyncio.sleep(life.REPORTED_EVERY_S)

    async def _check(self) -> None:
        """End the streams of expired sessions."""
        while True:
            await asyncio.sleep(CHECK_S)
            now = monotonic()
            self._trusted = {asked: known for asked, known in self._trusted.items() if known[1] > now}
            sessions = {reader.session for reader in self.readers if reader.session}
            if sessions:
                with suppress(Error):
                    self._end(sessions - set(await self._people.ask(viewers_of, sessions)))


class _Backstage:
    """What a source is given (:class:`core.streams.Backstage`)."""

    def __init__(self, people: Desk) -> None:
        self.ask = people.ask
        self.moved = asyncio.Event()

    async def rest(self, seconds: float) -> bool:
        with suppress(TimeoutError):
            await asyncio.wait_for(self.moved.wait(), max(seconds, 0.0))
        moved = self.moved.is_set()
        self.moved.clear()
        return moved


def _kind(topic: str) -> Any:
    return TOPICS.get(topic.partition(":")[0])
