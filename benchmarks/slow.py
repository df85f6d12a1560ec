"""``python -m benchmarks.slow [--json]``: what a site answers while many hold connections open and never finish.

Four ways to be slow: say nothing (``silent``), drip a header (``headers``), drip a form (``bodies``), or ask for a file
and take it a few bytes at a time (``readers``). Meanwhile somebody asks for the health page, another for a page, and
one sends a file of 64 MB. All of it in one process that mostly waits. The site has a database and a folder of its own;
beside it, in the same run, the same web server with a view that does nothing.
"""

from __future__ import annotations

import asyncio
import resource
import socket
import sys
import time
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit
from urllib.request import urlopen

from .board import database
from .load import server
from .report import command, report

KINDS = ("silent", "headers", "bodies", "readers")
CONNECTIONS = 1000
SECONDS = 10.0
DRIP_S = 10.0
PATIENCE_S = 20.0
HEALTH_S, PAGE_S = 0.1, 0.5
MEGABYTE = 1024 * 1024
READER_BUFFER = 4096
LARGE = "large"
HEALTH_MS, PAGE_MS = 100.0, 1000.0  # what is promised


@dataclass
class Figures:
    """What was asked beside the slow ones: seconds of each answer, by what was asked; ``failed`` had none."""

    open: int = 0
    most_open: int = 0
    failed: int = 0
    seconds: dict[str, list[float]] = field(default_factory=dict)

    def shown(self) -> dict[str, float | int]:
        """Milliseconds: median, 95th and 99th of a hundred and the longest of each, beside ``open`` and ``failed``."""
        found: dict[str, float | int] = {"slow_connections": self.most_open, "failed": self.failed}
        for name, all_seconds in self.seconds.items():
            ordered = sorted(all_seconds)
            for label, share in (("p50", 0.5), ("p95", 0.95), ("p99", 0.99), ("max", 1.0)):
                at = min(len(ordered) - 1, int(len(ordered) * share))
                found[f"{name}_{label}_ms"] = round(ordered[at] * 1000, 1)
        return found


def measure(
    address: str,
    kind: str,
    connections: int = CONNECTIONS,
    seconds: float = SECONDS,
    page: str = "/",
    file: str = "/",
    upload_mb: int = 0,
    upload_to: str = "/api/v1/models/",
    token: str = "",
) -> Figures:
    """Hold ``connections`` slow ones of a ``kind`` open at ``address`` (http://host:port) and time what else is asked
    for ``seconds``: ``/health/live``, ``page``, and ``upload_mb`` sent once where it is not 0. ``file`` is what slow
    readers ask for; it must be larger than a socket's buffers to keep them waiting."""
    _many_files()
    where = urlsplit(address)
    return asyncio.run(
        _measure((where.hostname or "", where.port or 80), kind, connections, seconds, page, file,
                 upload_mb, upload_to, token)
    )  # fmt: skip


async def _measure(
    where: tuple[str, int],
    kind: str,
    connections: int,
    seconds: float,
    page: str,
    file: str,
    upload_mb: int,
    upload_to: str,
    token: str,
) -> Figures:
    figures = Figures()
    slow = [asyncio.create_task(_slow(where, kind, file, figures)) for _ in range(connections)]
    try:
        await asyncio.sleep(min(3.0, 0.5 + connections / 500))
        end = time.monotonic() + seconds
        asked: list[Coroutine[Any, Any, object]] = [
            _again_and_again(figures, "health", HEALTH_S, end, lambda: _get(where, "/health/live")),
            _again_and_again(figures, "page", PAGE_S, end, lambda: _get(where, page)),
        ]
        if upload_mb:
            asked.append(_once(figures, "upload", lambda: _send(where, upload_to, upload_mb * MEGABYTE, token)))
        await asyncio.gather(*asked)
    finally:
        for task in slow:
            task.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
    return figures


async def _slow(where: tuple[str, int], kind: str, file: str, figures: Figures) -> None:
    """One slow connection, opened again whenever the server has had enough of it."""
    while True:
        try:
            await _slow_once(where, kind, file, figures)
        except OSError:
            await asyncio.sleep(1)


async def _slow_once(where: tuple[str, int], kind: str, file: str, figures: Figures) -> None:
    loop = asyncio.get_running_loop()
    client = socket.socket(socket.AF_INET6 if ":" in where[0] else socket.AF_INET)
    if kind == "readers":
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, READER_BUFFER)
    client.setblocking(False)
    counted = False
    try:
        await loop.sock_connect(client, where)
        figures.open += 1
        figures.most_open = max(figures.most_open, figures.open)
        counted = True
        host = f"Host: {where[0]}:{where[1]}\r\n"
        if kind == "headers":
            await loop.sock_sendall(client, f"GET / HTTP/1.1\r\n{host}X-Slow: ".encode())
        elif kind == "bodies":
            form = "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 1000\r\n"
            form += f"Cookie: csrftoken={'a' * 32}\r\n"  # without one Django refuses before it reads the form
            await loop.sock_sendall(client, f"POST /accounts/login/ HTTP/1.1\r\n{host}{form}\r\n".encode())
        elif kind == "readers":
            await loop.sock_sendall(client, f"GET {file} HTTP/1.1\r\n{host}\r\n".encode())
        while True:
            if kind == "readers":
                await asyncio.sleep(1)
                if not await loop.sock_recv(client, 16):
                    return
                continue
            try:
                async with asyncio.timeout(DRIP_S):
                    await loop.sock_recv(client, 4096)
                return  # an answer or the end: this one was not let wait
            except TimeoutError:
                if kind != "silent":
                    await loop.sock_sendall(client, b"x")
    finally:
        figures.open -= counted
        client.close()


async def _again_and_again(
    figures: Figures, name: str, pause: float, end: float, ask: Callable[[], Awaitable[None]]
) -> None:
    while time.monotonic() < end:
        took = await _once(figures, name, ask)
        await asyncio.sleep(max(0.0, pause - took))


async def _once(figures: Figures, name: str, ask: Callable[[], Awaitable[None]]) -> float:
    start = time.perf_counter()
    try:
        async with asyncio.timeout(PATIENCE_S if name != "upload" else 3 * PATIENCE_S):
            await ask()
    except (OSError, TimeoutError, ValueError, asyncio.IncompleteReadError):
        figures.failed += 1
    took = time.perf_counter() - start
    figures.seconds.setdefault(name, []).append(took)
    return took


async def _get(where: tuple[str, int], path: str) -> None:
    reader, writer = await asyncio.open_connection(*where)
    try:
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {where[0]}:{where[1]}\r\nConnection: close\r\n\r\n".encode())
        answer = await reader.read()
    finally:
        writer.close()
    if not answer.startswith(b"HTTP/1.1 200"):
        raise ValueError(answer[:100])


async def _send(where: tuple[str, int], path: str, size: int, token: str) -> None:
    """A file in a form of ``size`` bytes; any answer that is not the server's own fault will do."""
    reader, writer = await asyncio.open_connection(*where)
    try:
        head = b'--cut\r\nContent-Disposition: form-data; name="package"; filename="m.tar.gz"\r\n\r\n'
        tail = b"\r\n--cut--\r\n"
        writer.write(
            f"POST {path} HTTP/1.1\r\nHost: {where[0]}:{where[1]}\r\nConnection: close\r\n"
            f"Content-Type: multipart/form-data; boundary=cut\r\nContent-Length: {len(head) + size + len(tail)}\r\n"
            f"{f'Authorization: Token {token}' if token else 'X-None: 1'}\r\n\r\n".encode()
        )
        writer.write(head)
        chunk = bytes(MEGABYTE)
        for _ in range(size // MEGABYTE):
            writer.write(chunk)
            await writer.drain()
        writer.write(tail)
        answer = await reader.read()
    finally:
        writer.close()
    if not answer.startswith(b"HTTP/1.1 ") or answer.startswith(b"HTTP/1.1 5"):
        raise ValueError(answer[:100])


def _many_files() -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def everything(connections: int = CONNECTIONS, seconds: float = SECONDS, upload_mb: int = 64) -> dict[str, Any]:
    """The figures of each kind at the bare view and at a site that runs; ``ratio``: the median of its page by the bare
    view's. Django is set up on an empty database. Raises LoadError where a server does not start."""
    from django.conf import settings
    from django.utils import timezone

    from accounts.tokens.services import create_token
    from tests.factories import a_racer

    large = settings.STATIC_ROOT / LARGE
    with large.open("wb") as file:
        file.truncate(32 * MEGABYTE)
    token = create_token(racer=a_racer("sender"), now=timezone.now())[1]
    found: dict[str, Any] = {"connections": connections}
    with _broker(), server("benchmarks.bare", 2) as (bare, _), server("config.wsgi", 2) as (site, _):
        for _ in range(8):  # each process reads its templates once
            urlopen(f"{site}/", timeout=60).close()
        for kind in KINDS:
            plain = measure(bare, kind, connections, seconds).shown()
            own = measure(site, kind, connections, seconds, "/", f"/static/{LARGE}", upload_mb, token=token).shown()
            found[kind] = {"bare": plain, "site": own, "ratio": round(own["page_p50_ms"] / plain["page_p50_ms"], 2)}
    return found


def _broker() -> AbstractContextManager:
    """The site's own: limits of uploads are counted there."""
    from django.conf import settings

    from config.serving import broker
    from tests.servers import answers, running

    broker.make_private(settings.VALKEY_DIR)
    broker.make_private(settings.VALKEY_SOCKET.parent)
    command = broker.server_command(settings.VALKEY_DIR, settings.VALKEY_SOCKET)
    return running(command, lambda: answers(settings.VALKEY_SOCKET))


def misses(figures: dict[str, Any]) -> list[str]:
    """The promises that the figures do not keep."""
    found = []
    for kind in KINDS:
        own = figures[kind]["site"]
        if own["failed"] or own["slow_connections"] < figures["connections"]:
            found.append(f"{kind}: {own['failed']} failed, {own['slow_connections']} slow connections open")
        found += [f"{kind}: health p95 {own['health_p95_ms']} ms"] * (own["health_p95_ms"] > HEALTH_MS)
        found += [f"{kind}: page p95 {own['page_p95_ms']} ms"] * (own["page_p95_ms"] > PAGE_MS)
    return found


def table(figures: dict[str, Any]) -> str:
    """The figures for reading."""
    return "\n".join(
        f"{kind}: {figures[kind]['site']}, page {figures[kind]['ratio']} times the bare view's" for kind in KINDS
    )


def main(arguments: list[str] | None = None) -> int:
    """Each kind in turn, as a table or as one JSON object; 1 when a promise is not kept."""
    parser = command("slow", "What a site answers while slow clients hold its connections.")
    parser.add_argument("--connections", type=int, default=CONNECTIONS)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    options = parser.parse_args(arguments)
    with database(on_postgres=False):
        figures = everything(options.connections, options.seconds)
    return report(figures, as_json=options.json, table=table, missed=misses(figures))


if __name__ == "__main__":
    sys.exit(main())
