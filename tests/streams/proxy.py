"""A proxy in front of a site, as some networks have them: it passes everything on but the stream, with which it does
what a test says."""

from __future__ import annotations

import select
import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from time import monotonic

PASSES, REFUSES, HOLDS = "passes", "refuses", "holds"
CUTS = "cuts"
CUT_AFTER_S = 1.5
_BAD_GATEWAY = b"HTTP/1.1 502 Bad Gateway\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


class Proxy:
    """``does``: what happens to streams, those that are open as well. Passed on; refused with 502; held back, as by one
    that wants a whole answer before it sends a byte; or cut :data:`CUT_AFTER_S` after they began."""

    def __init__(self, port: int) -> None:
        self.does = PASSES
        self.streams = 0  # that were asked for
        self._behind = port
        self._listens = socket.create_server(("127.0.0.1", 0), backlog=64)
        self._is_over = False
        threading.Thread(target=self._take, daemon=True).start()

    @property
    def address(self) -> str:
        """Where browsers reach it."""
        return f"http://127.0.0.1:{self._listens.getsockname()[1]}"

    def close(self) -> None:
        self._is_over = True
        self._listens.close()

    def _take(self) -> None:
        with suppress(OSError):  # it was closed
            while True:
                taken, _ = self._listens.accept()
                threading.Thread(target=self._serve, args=(taken,), daemon=True).start()

    def _serve(self, taken: socket.socket) -> None:
        with closing(taken), suppress(OSError):
            head, body = _request(taken)
            if not head:
                return
            is_stream = head.split(b" ", 2)[1].startswith(b"/stream/?")
            self.streams += is_stream
            if is_stream and self.does == REFUSES:
                taken.sendall(_BAD_GATEWAY)
                return
            # an answer for each connection: nothing has to be told apart
            lines = [line for line in head.split(b"\r\n") if not line.lower().startswith(b"connection:")]
            with closing(socket.create_connection(("127.0.0.1", self._behind))) as behind:
                behind.sendall(b"\r\n".join([*lines, b"Connection: close", b"", b""]) + body)
                self._pass_on(behind, taken, is_stream)

    def _pass_on(self, behind: socket.socket, taken: socket.socket, is_stream: bool) -> None:
        began, held = monotonic(), b""
        while not self._is_over:
            if is_stream and (self.does == REFUSES or (self.does == CUTS and monotonic() > began + CUT_AFTER_S)):
                return
            ready, _, _ = select.select([behind, taken], [], [], 0.2)
            if taken in ready and not taken.recv(65536, socket.MSG_PEEK):
                return  # the browser has left
            if behind not in ready:
                continue
            held += (some := behind.recv(65536))
            if not (is_stream and self.does == HOLDS):
                taken.sendall(held)
                held = b""
            if not some:
                return


def _request(taken: socket.socket) -> tuple[bytes, bytes]:
    """The head of a request without its empty line, and its body."""
    read = b""
    while b"\r\n\r\n" not in read:
        some = taken.recv(65536)
        if not some:
            return b"", b""
        read += some
    head, body = read.split(b"\r\n\r\n", 1)
    sizes = [line.split(b":", 1)[1] for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:")]
    while len(body) < int(sizes[0] if sizes else 0):
        body += taken.recv(65536)
    return head, body


@contextmanager
def before(port: int) -> Iterator[Proxy]:
    """A proxy before the web server at a port."""
    proxy = Proxy(port)
    try:
        yield proxy
    finally:
        proxy.close()
