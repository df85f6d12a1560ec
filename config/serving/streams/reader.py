"""One open stream: what its reader follows, and what waits to be sent."""

import asyncio
import json
from collections.abc import Callable, Collection
from time import monotonic
from typing import Any

from core.metrics import Counter

HELD_BYTES = 64 * 1024  # of what a reader has not taken; then they are cut, and come back for it
NUMBERS_SENT = 50
MESSAGES = Counter("paddock_stream_messages_total", "Messages to the readers of streams.")


class Reader:
    """``topics``: what was asked for. ``session``: of the browser, empty for a guest. ``position``: up to where the
    reader is up to date."""

    def __init__(self, topics: frozenset[str], session: str, address: str, cut: Callable[[], None]) -> None:
        self.topics, self.session, self.address = topics, session, address
        self.may: set[str] = set()  # of the topics, when that was last asked
        self.position = 0
        self.sent_at = monotonic()
        self.is_over = False
        self.waits_for_past = True  # new events wait until the past has been sent
        self._cut = cut
        self._waiting: list[bytes] = []
        self._later: list[bytes | tuple[Collection[int], Collection[str], int]] = []
        self._held = 0
        self._news = asyncio.Event()

    def tell_moves(self, numbers: Collection[int], topics: Collection[str], position: int) -> None:
        """Tell that topics moved. ``numbers``: the positions of the events, ``position``: up to where this is all."""
        if self.waits_for_past:
            self._later.append((numbers, topics, position))
            return
        self.position = position
        moves: dict[str, list[str] | list[int]] = {"of": sorted(topics)}
        if numbers:
            moves["at"] = sorted(numbers)[-NUMBERS_SENT:]
        self._put(message(moves, position=position if numbers else None))

    def tell_past(self, first: list[bytes]) -> None:
        """Send the past, and then the messages that came meanwhile."""
        self.waits_for_past = False
        for each in first:
            self._put(each)
        later, self._later = self._later, []
        for one in later:
            if isinstance(one, bytes):
                self._put(one)
            else:
                self.tell_moves(*one)

    def tell(self, sent: bytes) -> None:
        """Send a message without a position."""
        if self.waits_for_past:
            self._later.append(sent)
        else:
            self._put(sent)

    def cut(self) -> None:
        """End it now, without what waits: the reader takes nothing, and comes back for it."""
        self.is_over, self._waiting = True, []
        self._news.set()
        self._cut()

    def end(self, last: bytes = b"") -> None:
        if last:
            self._put(last)
        self.is_over = True
        self._news.set()

    async def next(self) -> bytes:
        """All waiting messages, as soon as there is one; empty at the end."""
        while not self._waiting and not self.is_over:
            self._news.clear()
            await self._news.wait()
        taken, self._waiting, self._held = b"".join(self._waiting), [], 0
        self.sent_at = monotonic()
        return taken

    def _put(self, sent: bytes) -> None:
        if self.is_over:
            return
        self._held += len(sent)
        if self._held > HELD_BYTES:
            self.cut()
            return
        self._waiting.append(sent)
        self._news.set()
        MESSAGES.inc()


def message(data: Any, *, event: str = "", position: int | None = None) -> bytes:
    lines = [] if position is None else [f"id: {position}"]
    if event:
        lines.append(f"event: {event}")
    lines.append(f"data: {json.dumps(data, separators=(',', ':'))}")
    return ("\n".join(lines) + "\n\n").encode()


def data_message(topic: str, data: Any) -> bytes:
    return message({"to": topic, "data": data}, event="said")
