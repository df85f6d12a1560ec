"""How much of a request the web server takes before anybody has looked at it.

It takes requests whole, so what they weigh is bounded here, before Django: only what may carry a model may be large,
and only from somebody who shows a session or a token. A request that announces more is handed on without its body: the
site's own bounds refuse it, with a page or an answer that says so.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from django.conf import settings
from waitress.channel import HTTPChannel
from waitress.parser import HTTPRequestParser
from waitress.utilities import Error, RequestEntityTooLarge

from config.body_limit import FORM_MB, MEGABYTE, OVERHEAD_BYTES, takes_models
from config.streams.handover import MOST_BYTES as HEADER_BYTES
from config.streams.handover import Sender, is_for_stream, is_whole

SMALL_BYTES = FORM_MB * MEGABYTE + OVERHEAD_BYTES
# What all unfinished large requests of one process may come to, in the largest uploads: they lie on its disk
UPLOADS_TAKEN = 4


def largest_body() -> int:
    """Bytes of the largest request that may be taken."""
    return settings.UPLOAD_LIMIT_MB * MEGABYTE + OVERHEAD_BYTES + 1


class TooManyAtOnce(Error):
    """What one is told who sends a large upload while as many as fit are coming in."""

    code = 503
    reason = "Service Unavailable"


class Request(HTTPRequestParser):
    """A request as it comes in."""

    body_rcv: Any  # Waitress's own
    content_length: int

    def __init__(self, adj: Any, server: Any = None) -> None:
        super().__init__(adj)
        self._server = server
        self._bound = SMALL_BYTES

    def parse_header(self, header_plus: bytes) -> None:
        """Raises what Waitress raises for a malformed one."""
        super().parse_header(header_plus)
        if self.body_rcv is None:
            return
        if self._may_be_large():
            self._bound = largest_body() - 1
        if self.content_length > self._bound:
            self.body_rcv = None  # the site refuses what is announced
            self.content_length = 0
            self.headers["CONNECTION"] = "close"  # what follows is no request
        elif (self.content_length > SMALL_BYTES or self.chunked) and self._taken() > UPLOADS_TAKEN * largest_body():
            self.body_rcv = None
            self.content_length = 0
            self.error = TooManyAtOnce("too many large uploads at once")

    def received(self, data: bytes) -> int:
        """How many of the bytes belong to this request."""
        consumed = super().received(data)
        if self.chunked and self.body_bytes_received > self._bound and self.error is None:
            self.error = RequestEntityTooLarge(f"exceeds {self._bound} bytes")
            self.completed = True
        return consumed

    def weight(self) -> int:
        """Bytes that this request lays, or may yet lay, on the disk."""
        return max(self.content_length if self.content_length > SMALL_BYTES else 0, self.body_bytes_received)

    def _may_be_large(self) -> bool:
        if not takes_models(self.path):
            return False
        return "AUTHORIZATION" in self.headers or f"{settings.SESSION_COOKIE_NAME}=" in self.headers.get("COOKIE", "")

    def _taken(self) -> int:
        channels = list(self._server.active_channels.values()) if self._server is not None else []
        requests = [request for channel in channels for request in (*channel.requests, channel.request) if request]
        return sum(request.weight() for request in requests if request is not self)


class Channel(HTTPChannel):
    """A connection whose requests are bounded as above, and that goes to the stream process when it asks for a stream
    (:mod:`config.streams.handover`). If that does not take it, the site answers."""

    requests: list[Any]  # Waitress's own
    total_outbufs_len: int

    def __init__(self, server: Any, *args: Any, **kwargs: Any) -> None:
        super().__init__(server, *args, **kwargs)
        self.parser_class = partial(Request, server=server)
        self._streams: Sender = server.streams
        self._asked = b""  # for a stream, as far as it has come

    def received(self, data: bytes) -> bool:
        if not self._asked and (self.request is not None or not is_for_stream(data)):
            return super().received(data)
        self._asked += data
        self._go()
        return True

    def readable(self) -> bool:
        if self._asked and self._go():  # what was asked for before has been answered by now
            return False
        return super().readable()

    def _go(self) -> bool:
        """Hand over, as soon as all of the request is there and everything before it is answered. Whether this
        connection is gone now."""
        whole = is_whole(self._asked)
        if self.requests or self.total_outbufs_len or not (whole or len(self._asked) > HEADER_BYTES):
            return False
        asked, self._asked = self._asked, b""
        if whole and len(asked) <= HEADER_BYTES and self._streams.hand_over(self.socket.fileno(), asked):
            self.handle_close()
            return True
        super().received(asked)
        return False


def without_body(application: Any) -> Any:
    """The application, whose answers to HEAD are headers only: Waitress sends what it is given."""

    def answer(environ: dict[str, Any], start_response: Any) -> Any:
        made = application(environ, start_response)
        if environ["REQUEST_METHOD"] != "HEAD":
            return made
        if hasattr(made, "close"):
            made.close()
        return [b""]

    return answer
