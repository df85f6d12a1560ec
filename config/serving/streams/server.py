"""Uvicorn, serving its port and the connections that the web server hands over."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import uvicorn
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from config.serving.request_head import END, announces_body, head_fault, is_malformed

from .application import Application
from .handover import MOST_BYTES as HEADER_BYTES
from .handover import listen, receive
from .hub import Hub

logger = logging.getLogger(__name__)
ENDS_WITHIN_S = 3
SILENT_MS = 60_000  # a reader whose machine confirms nothing for so long has gone
SENT_BYTES = 32 * 1024
KEEPS_ALIVE_S = 5
_open: dict[Any, Protocol] = {}


class Protocol(HttpToolsProtocol):
    """A connection that can be cut, buffers little, and carries one request without a body; every answer closes it."""

    _head: bytes | None = b""  # as far as it was received; None: it has been answered or is being answered

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        _open[self.client] = self
        held = transport.get_extra_info("socket")
        if held is not None and held.family in (socket.AF_INET, socket.AF_INET6):
            held.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, SILENT_MS)
            held.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)

    def data_received(self, data: bytes) -> None:
        if self._head is None:
            return
        received, checked = self._head + data, len(self._head)
        head, end, _ = received.partition(END)
        is_whole = bool(end)
        if is_malformed(received, checked) or len(head) > HEADER_BYTES or (is_whole and _is_refused(head)):
            self._head = None
            self.send_400_response("The request is malformed, or has a body.")
        elif is_whole:
            self._head = None
            super().data_received(head + end)
        else:
            self._head = received

    def connection_lost(self, exc: Exception | None) -> None:
        if _open.get(self.client) is self:
            del _open[self.client]
        super().connection_lost(exc)


def _is_refused(head: bytes) -> bool:
    return head_fault(head) is not None or announces_body(head)


def cut(client: Any) -> None:
    """End a connection now, without its unsent data."""
    found = _open.get(client)
    if found is not None and found.transport is not None:
        found.transport.abort()


class Server(uvicorn.Server):
    """Both kinds of connections, until SIGTERM or SIGINT."""

    def __init__(self, config: uvicorn.Config, hub: Hub, handed_over: socket.socket | None) -> None:
        super().__init__(config)
        self._hub = hub
        self._handed_over = handed_over
        self._links: set[socket.socket] = set()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        loop = asyncio.get_running_loop()
        for signum in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(signum, self._stop)
        yield

    def _stop(self) -> None:
        self.should_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._hub.start()
        if self._handed_over is not None:
            asyncio.get_running_loop().add_reader(self._handed_over, self._accept)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        if self._handed_over is not None:
            for link in (self._handed_over, *self._links):
                asyncio.get_running_loop().remove_reader(link)
                link.close()
        await self._hub.close()
        await super().shutdown(sockets)

    def _accept(self) -> None:
        assert self._handed_over is not None
        with contextlib.suppress(BlockingIOError):
            while True:
                link, _ = self._handed_over.accept()
                link.setblocking(False)
                self._links.add(link)
                asyncio.get_running_loop().add_reader(link, self._take, link)

    def _take(self, link: socket.socket) -> None:
        try:
            given = receive(link)
            while given is not None:
                task = asyncio.create_task(self._begin(*given))
                self.server_state.tasks.add(task)
                task.add_done_callback(self.server_state.tasks.discard)
                given = receive(link)
        except BlockingIOError:
            return
        except OSError as error:
            logger.warning("A link to the web server broke (%s).", error)
        asyncio.get_running_loop().remove_reader(link)
        self._links.discard(link)
        link.close()

    async def _begin(self, connection: socket.socket, received: bytes) -> None:
        def protocol() -> Protocol:
            return Protocol(config=self.config, server_state=self.server_state, app_state=self.lifespan.state)

        try:
            _, begun = await asyncio.get_running_loop().connect_accepted_socket(protocol, connection)
        except OSError:  # it has gone meanwhile
            connection.close()
            return
        begun.data_received(received)


def serve(listening: list[socket.socket], handed_over: Path | None) -> None:
    """Serve to the end. ``listening``: our own sockets; ``handed_over``: where web servers hand connections over.
    Raises OSError when it cannot listen there."""
    hub = Hub()
    config = uvicorn.Config(
        Application(hub, cut),
        loop="uvloop",
        http=Protocol,
        ws="none",
        lifespan="off",
        log_config=None,
        access_log=False,
        proxy_headers=False,  # settings say which are believed
        server_header=False,
        date_header=False,
        timeout_keep_alive=KEEPS_ALIVE_S,
        timeout_graceful_shutdown=ENDS_WITHIN_S,
        backlog=2048,
    )
    taken = listen(handed_over) if handed_over is not None else None
    server = Server(config, hub, taken)
    server.run(sockets=listening)
