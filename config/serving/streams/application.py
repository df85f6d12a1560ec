"""The ASGI application of the stream process.

``GET /stream/?of=race:7&of=me&last=812``: the stream. ``of``: topics (:mod:`core.streams.topics`); a program sends a
token of the API (``Authorization: Bearer``) and is refused hidden topics; ``last``: the position that it knows, without
``Last-Event-ID``. ``GET /stream/health``: figures of this process. ``GET /stream/clock``: the time.
"""

import asyncio
import json
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Any, TypeAlias
from urllib.parse import parse_qsl

from django.conf import settings
from django.db import Error
from django.http.request import split_domain_port, validate_host

from config.middleware.request_ids import HEADER as REQUEST_ID
from config.middleware.request_ids import begin
from core.logs.lines import request_id
from core.streams.topics import asked_for
from paddock.errors.reasons import REASONS
from races.web.spectator_links import COOKIE, HEADER, tokens_in

from .feed import Desk
from .hub import Hub
from .reader import Reader
from .viewers import followed, name_of, token_name_of, viewers_of

if TYPE_CHECKING:
    from asgiref.typing import HTTPScope

TOPICS = 32
LONGEST_QUERY = 4096
SESSION_KEY_LENGTH = 64
UNKNOWN = -1  # no valid position: the reader must reload everything
TAKES_NOTHING_S = 30.0  # a reader who takes nothing for so long is cut
_STREAM = [
    (b"content-type", b"text/event-stream; charset=utf-8"),
    (b"cache-control", b"no-store"),
    (b"x-accel-buffering", b"no"),  # nginx passes on what it gets
    (b"x-content-type-options", b"nosniff"),
    (b"connection", b"close"),  # what comes next on a connection that was handed over is not for us
]
Scope: TypeAlias = "HTTPScope"
Receive: TypeAlias = Callable[[], Awaitable[Any]]
Send: TypeAlias = Callable[[Any], Awaitable[None]]


class NoStream(Exception):
    """A request that gets no stream. ``code``: a reason of :mod:`config.reasons`, which has the ``status``."""

    def __init__(self, code: str, retry_s: int = 0, status: int = 0) -> None:
        super().__init__(code)
        self.reason, self.retry_s, self.status = REASONS[code], retry_s, status or REASONS[code].status


class Application:
    """``cut(client)``: ends a connection at once, whatever waits to be sent on it."""

    def __init__(self, hub: Hub, cut: Callable[[Any], None]) -> None:
        self.hub = hub
        self._cut = cut
        self._viewers = Desk("viewers", 1)
        self._of_address: Counter[str] = Counter()
        self._of_racer: Counter[int] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        try:
            headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
            begin(headers.get(REQUEST_ID.lower(), ""))
            _check(scope, headers)
            if scope["path"] == "/stream/health":
                await _answer(send, 200, self.hub.figures())
                return
            if scope["path"] == "/stream/clock":
                await _answer(send, 200, {"now": round(time.time() * 1000)})
                return
            await self._stream(scope, headers, receive, send)
        except NoStream as refused:
            reason = refused.reason
            error = {"code": reason.code, "message": reason.sentence, "fault": reason.fault, "params": {}}
            await _answer(send, refused.status, error | {"detail": reason.sentence}, refused.retry_s)

    async def _stream(self, scope: Scope, headers: dict[str, str], receive: Receive, send: Send) -> None:
        written, last = _asked(scope, headers)
        address = _address(scope, headers)
        if len(self.hub.readers) >= settings.STREAMS:
            raise NoStream("streams_full", 30)
        if self._of_address[address] >= settings.STREAMS_PER_ADDRESS:
            raise NoStream("streams_of_address", 30)
        shown = headers.get("authorization")
        browsers, racer = _browsers(headers) if shown is None else [token_name_of(shown)], None
        self._of_address[address] += 1
        try:
            browser, racer, topics = await self._identify_reader(browsers, written, is_program=shown is not None)
            if racer is not None:
                if self._of_racer[racer] >= settings.STREAMS_PER_RACER:
                    racer = None
                    raise NoStream("streams_of_racer", 30)
                self._of_racer[racer] += 1
            reader = Reader(topics, browser, address, lambda: self._cut(scope["client"]))
            await self._serve(reader, last, receive, send)
        finally:
            _count_off(self._of_address, address)
            if racer is not None:
                _count_off(self._of_racer, racer)

    async def _identify_reader(
        self, browsers: list[str], written: list[str], *, is_program: bool
    ) -> tuple[str, int | None, frozenset[str]]:
        """The name of the reader's browser (empty for a guest), the racer's primary key, and the topics to follow.

        A page silently gets the topics that it may follow. A program is refused as a whole, with the same answer for
        unknown and hidden topics.
        """
        try:
            viewers = await self._viewers.ask(viewers_of, browsers) if browsers else {}
        except Error:
            raise NoStream("streams_away", 5) from None
        browser = next((each for each in browsers if each in viewers), "")
        viewer = viewers.get(browser)
        if is_program and viewer is None:
            raise NoStream("stream_token")
        try:
            topics = frozenset(asked_for(written, viewer))
        except ValueError:
            raise NoStream("stream_topics") from None
        if is_program:
            if not topics:
                raise NoStream("stream_topics")
            try:
                may = await self._viewers.ask(followed, topics, viewer)
            except Error:
                raise NoStream("streams_away", 5) from None
            if may != topics:
                raise NoStream("stream_topic_hidden")
        return browser, viewer.pk if viewer is not None else None, topics

    async def _serve(self, reader: Reader, last: int | None, receive: Receive, send: Send) -> None:
        gone = asyncio.create_task(_until_gone(receive))
        gone.add_done_callback(lambda _: reader.end())
        try:
            try:
                await self.hub.come(reader, last)
            except Error:
                raise NoStream("streams_away", 5) from None
            await send({"type": "http.response.start", "status": 200, "headers": [*_STREAM, _id_header()]})
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


async def _answer(send: Send, status: int, document: Mapping[str, object], retry_s: int = 0) -> None:
    headers = [(b"content-type", b"application/json"), (b"cache-control", b"no-store"), (b"connection", b"close")]
    headers.append(_id_header())
    if status == 401:
        headers.append((b"www-authenticate", b"Bearer"))
    if retry_s:
        headers.append((b"retry-after", str(retry_s).encode()))
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": json.dumps(document).encode()})


def _id_header() -> tuple[bytes, bytes]:
    return REQUEST_ID.lower().encode(), request_id.get().encode()


def _check(scope: Scope, headers: dict[str, str]) -> None:
    """Raises NoStream for other requests than those of the site's pages and programs."""
    if scope["path"] not in ("/stream/", "/stream/health", "/stream/clock"):
        raise NoStream("stream_refused", status=404)
    if scope["method"] != "GET":
        raise NoStream("stream_refused", status=405)
    host, _ = split_domain_port(headers.get("host", ""))
    if not host or not validate_host(host, settings.ALLOWED_HOSTS) or headers.get("sec-fetch-site") == "cross-site":
        raise NoStream("stream_refused")


def _asked(scope: Scope, headers: dict[str, str]) -> tuple[list[str], int | None]:
    """The topics as they were written, and the position that the reader knows. Raises NoStream."""
    query = scope["query_string"]
    if len(query) > LONGEST_QUERY:
        raise NoStream("stream_topics")
    given = parse_qsl(query.decode("latin-1"))
    written = sorted({value for name, value in given if name == "of"})
    if len(written) > TOPICS:
        raise NoStream("stream_topics")
    known = headers.get("last-event-id") or next((value for name, value in given if name == "last"), "")
    if not known:
        return written, None
    return written, int(known) if known.isascii() and known.isdecimal() and len(known) < 19 else UNKNOWN


def _browsers(headers: dict[str, str]) -> list[str]:
    """The keys of the reader's browser (:mod:`config.serving.streams.viewers`), the session first."""
    try:
        cookies = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        cookies = SimpleCookie()
    sent = {name: cookies[name].value if name in cookies else "" for name in (settings.SESSION_COOKIE_NAME, COOKIE)}
    session = sent[settings.SESSION_COOKIE_NAME]
    session = session if len(session) <= SESSION_KEY_LENGTH and not {*"|:"} & {*session} else ""
    tokens = (*tokens_in(sent[COOKIE]), *tokens_in(headers.get(HEADER.lower(), "")))
    named = [name_of(session, tokens)] if session else []
    return [*named, name_of("", tokens)] if tokens else named


def _address(scope: Scope, headers: dict[str, str]) -> str:
    """Whose connection it is, as the limits of log-in count it: behind proxies, what the outermost of ours has seen."""
    trusted = settings.ALLAUTH_TRUSTED_PROXY_COUNT
    forwarded = [each.strip() for each in headers.get("x-forwarded-for", "").split(",") if each.strip()]
    if trusted and forwarded:
        return forwarded[-min(trusted, len(forwarded))][:64]
    return scope["client"][0] if scope["client"] else ""


def _count_off(counter: Counter[Any], key: Any) -> None:
    counter[key] -= 1
    if not counter[key]:
        del counter[key]
