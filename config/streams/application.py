"""What the stream process answers, as an ASGI application of one address and a few refusals.

``GET /stream/?of=race:7&of=me&last=812``: the stream. ``of``: what the page shows (:mod:`core.streams.topics`);
``last``: the position up to which it knows everything, where the browser does not send ``Last-Event-ID``.
``GET /stream/health``: how this process is, in figures. ``GET /stream/clock``: the time, for pages that play a run at
the same instant as all others.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from http.cookies import CookieError, SimpleCookie
from typing import Any, TypeAlias
from urllib.parse import parse_qsl

from django.conf import settings
from django.db import Error
from django.http.request import split_domain_port, validate_host

from core.streams.topics import asked_for
from paddock.errors.reasons import REASONS
from races.spectators import COOKIE, HEADER, tokens_in

from .feed import Desk
from .hub import Hub
from .reader import Reader
from .viewers import name_of, viewers_of

TOPICS = 32
LONGEST_QUERY = 4096
SESSION_KEY_LENGTH = 64
TAKES_NOTHING_S = 30.0  # a reader who takes nothing for so long is cut
_STREAM = [
    (b"content-type", b"text/event-stream; charset=utf-8"),
    (b"cache-control", b"no-store"),
    (b"x-accel-buffering", b"no"),  # nginx passes on what it gets
    (b"x-content-type-options", b"nosniff"),
    (b"connection", b"close"),  # what comes next on a connection that was handed over is not for us
]
Scope: TypeAlias = dict[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[Any]]
Send: TypeAlias = Callable[[Any], Awaitable[None]]


class NoStream(Exception):
    """A request that gets no stream. ``code``: a reason of :mod:`config.reasons`."""

    def __init__(self, status: int, code: str, retry_s: int = 0) -> None:
        super().__init__(code)
        self.status, self.code, self.retry_s = status, code, retry_s


class Application:
    """``cut(client)``: ends a connection at once, whatever waits to be sent on it."""

    def __init__(self, hub: Hub, cut: Callable[[Any], None]) -> None:
        self.hub = hub
        self._cut = cut
        self._who = Desk("who", 1)
        self._of_address: Counter[str] = Counter()
        self._of_racer: Counter[int] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        try:
            headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
            _check(scope, headers)
            if scope["path"] == "/stream/health":
                await _answer(send, 200, self.hub.figures())
                return
            if scope["path"] == "/stream/clock":
                await _answer(send, 200, {"now": round(time.time() * 1000)})
                return
            await self._stream(scope, headers, receive, send)
        except NoStream as refused:
            told = {"code": refused.code, "detail": REASONS[refused.code].sentence}
            await _answer(send, refused.status, told, refused.retry_s)

    async def _stream(self, scope: Scope, headers: dict[str, str], receive: Receive, send: Send) -> None:
        written, last = _asked(scope, headers)
        address = _address(scope, headers)
        if len(self.hub.readers) >= settings.STREAMS:
            raise NoStream(503, "streams_full", 30)
        if self._of_address[address] >= settings.STREAMS_PER_ADDRESS:
            raise NoStream(429, "streams_of_address", 30)
        browsers, racer = _browsers(headers), None
        self._of_address[address] += 1
        try:
            browser, racer, topics = await self._who_asks(browsers, written)
            if racer is not None:
                if self._of_racer[racer] >= settings.STREAMS_PER_RACER:
                    racer = None
                    raise NoStream(429, "streams_of_racer", 30)
                self._of_racer[racer] += 1
            reader = Reader(topics, browser, address, lambda: self._cut(scope["client"]))
            await self._serve(reader, last, receive, send)
        finally:
            _count_off(self._of_address, address)
            if racer is not None:
                _count_off(self._of_racer, racer)

    async def _who_asks(self, browsers: list[str], written: list[str]) -> tuple[str, int | None, frozenset[str]]:
        """The name of the reader's browser (empty for any guest's), their number as a racer, and what they follow."""
        try:
            viewers = await self._who.ask(viewers_of, browsers) if browsers else {}
        except Error:
            raise NoStream(503, "streams_away", 5) from None
        browser = next((each for each in browsers if each in viewers), "")
        viewer = viewers.get(browser)
        try:
            return browser, viewer and viewer.pk, frozenset(asked_for(written, viewer))
        except ValueError:
            raise NoStream(400, "stream_topics") from None

    async def _serve(self, reader: Reader, last: int | None, receive: Receive, send: Send) -> None:
        gone = asyncio.create_task(_until_gone(receive))
        gone.add_done_callback(lambda _: reader.end())
        try:
            try:
                await self.hub.come(reader, last)
            except Error:
                raise NoStream(503, "streams_away", 5) from None
            await send({"type": "http.response.start", "status": 200, "headers": _STREAM})
            while sent := await reader.next():
                async with asyncio.timeout(TAKES_NOTHING_S):
                    await send({"type": "http.response.body", "body": sent, "more_body": True})
            await send({"type": "http.response.body", "body": b""})
        except TimeoutError:
            reader.cut()
        finally:
            gone.cancel()
            self.hub.leave(reader)


async def _until_gone(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass


async def _answer(send: Send, status: int, told: dict[str, Any], retry_s: int = 0) -> None:
    headers = [(b"content-type", b"application/json"), (b"cache-control", b"no-store"), (b"connection", b"close")]
    if retry_s:
        headers.append((b"retry-after", str(retry_s).encode()))
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": json.dumps(told).encode()})


def _check(scope: Scope, headers: dict[str, str]) -> None:
    """Raises NoStream for what is no request of a page of ours."""
    if scope["path"] not in ("/stream/", "/stream/health", "/stream/clock"):
        raise NoStream(404, "stream_refused")
    if scope["method"] != "GET":
        raise NoStream(405, "stream_refused")
    host, _ = split_domain_port(headers.get("host", ""))
    if not host or not validate_host(host, settings.ALLOWED_HOSTS) or headers.get("sec-fetch-site") == "cross-site":
        raise NoStream(403, "stream_refused")


def _asked(scope: Scope, headers: dict[str, str]) -> tuple[list[str], int | None]:
    """The topics as they were written, and the position that the reader knows. Raises NoStream."""
    query = scope["query_string"]
    if len(query) > LONGEST_QUERY:
        raise NoStream(400, "stream_topics")
    given = parse_qsl(query.decode("latin-1"))
    written = sorted({value for name, value in given if name == "of"})
    if len(written) > TOPICS:
        raise NoStream(400, "stream_topics")
    known = headers.get("last-event-id") or next((value for name, value in given if name == "last"), "")
    return written, int(known) if known.isascii() and known.isdecimal() and len(known) < 19 else None


def _browsers(headers: dict[str, str]) -> list[str]:
    """What the reader's browser may be named (:mod:`config.streams.viewers`), the one with its session first."""
    try:
        cookies = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        cookies = SimpleCookie()
    sent = {name: cookies[name].value if name in cookies else "" for name in (settings.SESSION_COOKIE_NAME, COOKIE)}
    session = sent[settings.SESSION_COOKIE_NAME]
    session = session if len(session) <= SESSION_KEY_LENGTH and "|" not in session else ""
    tokens = (*tokens_in(sent[COOKIE]), *tokens_in(headers.get(HEADER.lower(), "")))
    named = [name_of(session, tokens)] if session else []
    return [*named, name_of("", tokens)] if tokens else named


def _address(scope: Scope, headers: dict[str, str]) -> str:
    """Whose connection it is, as the limits of log-in count it: behind proxies, what the outermost of ours has seen."""
    trusted = settings.ALLAUTH_TRUSTED_PROXY_COUNT
    told = [each.strip() for each in headers.get("x-forwarded-for", "").split(",") if each.strip()]
    if trusted and told:
        return told[-min(trusted, len(told))][:64]
    return scope["client"][0] if scope["client"] else ""


def _count_off(counter: Counter[Any], key: Any) -> None:
    counter[key] -= 1
    if not counter[key]:
        del counter[key]
