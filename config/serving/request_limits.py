"""Limits the size and the form of requests in the web server, before Django reads them.

Waitress receives requests whole: only uploads of models may be large, and only with a session or a token. A larger
announced body is not read, and the site's own limits refuse it.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

from django.conf import settings
from waitress.channel import HTTPChannel
from waitress.parser import HTTPRequestParser, ParsingError
from waitress.utilities import BadRequest, Error, RequestEntityTooLarge

from config.middleware.body_limit import FORM_MB, MEGABYTE, OVERHEAD_BYTES, takes_models
from config.serving.chunked_body import ChunkedBody
from config.serving.request_head import END, announces_body, head_fault, is_malformed
from config.serving.streams.handover import MOST_BYTES as HEADER_BYTES
from config.serving.streams.handover import Sender, is_for_stream

SMALL_BYTES = FORM_MB * MEGABYTE + OVERHEAD_BYTES
# What all unfinished large requests of one process may come to, in the largest uploads: they lie on its disk
UPLOADS_TAKEN = 4


def largest_body() -> int:
    return settings.UPLOAD_LIMIT_MB * MEGABYTE + OVERHEAD_BYTES + 1


class TooManyAtOnce(Error):
    """The answer to a large upload while the limit of concurrent uploads is reached."""

    code = 503
    reason = "Service Unavailable"


class Request(HTTPRequestParser):
    body_rcv: Any  # Waitress's own
    content_length: int

    def __init__(self, adj: Any, server: Any = None) -> None:
        super().__init__(adj)
        self._server = server
        self._bound = SMALL_BYTES

    def parse_header(self, header_plus: bytes) -> None:
        """Raises ParsingError for a malformed one: it is answered with 400, and the connection is closed."""
        fault = head_fault(header_plus)
        if fault is not None:
            raise ParsingError(fault)
        super().parse_header(header_plus)
        if self.body_rcv is None:
            self.expect_continue = False  # there is nothing to continue with
            return
        if self.chunked:
            self.body_rcv = ChunkedBody(self.body_rcv.getbuf())
        if self._may_be_large():
            self._bound = largest_body() - 1
        if self.content_length > self._bound:
            self.body_rcv = None  # the site refuses what is announced
            self.content_length = 0
            self.expect_continue = False
            self.headers["CONNECTION"] = "close"  # what follows is no request
        elif (self.content_length > SMALL_BYTES or self.chunked) and self._taken() > UPLOADS_TAKEN * largest_body():
            self.body_rcv = None
            self.content_length = 0
            self.expect_continue = False
            self.error = TooManyAtOnce("too many large uploads at once")

    def received(self, data: bytes) -> int:
        """How many of the bytes belong to this request."""
        if self.body_rcv is None and is_malformed(self.header_plus + data, len(self.header_plus)):
            super().parse_header(b"GET / HTTP/1.0\r\n")
            self.error = BadRequest("The head of the request is malformed.")
            self.completed = True
            return len(data)
        consumed = super().received(data)
        if self.chunked and self.body_bytes_received > self._bound and self.error is None:
            self.error = RequestEntityTooLarge(f"exceeds {self._bound} bytes")
            self.completed = True
        return consumed if self.error is None else len(data)

    def weight(self) -> int:
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
    """A connection with bounded requests, handed over to the stream process when it requests a stream
    (:mod:`config.serving.streams.handover`). If that does not take it, the site answers."""

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
        """Hand over, as soon as the whole request is there and everything before it is answered. Whether this
        connection is gone now."""
        malformed = is_malformed(self._asked)
        whole = END in self._asked and not malformed
        if self.requests or self.total_outbufs_len or not (whole or malformed or len(self._asked) > HEADER_BYTES):
            return False
        asked, self._asked = self._asked, b""
        head = asked.partition(END)[0]
        fits = whole and len(asked) <= HEADER_BYTES and head_fault(head) is None and not announces_body(head)
        if fits and self._streams.hand_over(self.socket.fileno(), asked):
            self.handle_close()
            return True
        super().received(asked)
        return False


def without_body(application: Any) -> Any:
    """The application, whose answers to HEAD are headers only: Waitress sends what it is given."""

    def answer(environ: Mapping[str, object], start_response: Any) -> Any:
        made = application(environ, start_response)
        if environ["REQUEST_METHOD"] != "HEAD":
            return made
        if hasattr(made, "close"):
            made.close()
        return [b""]

    return answer
