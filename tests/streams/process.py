"""A stream process that is really started, on the database of the tests, and readers of its streams."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any
from urllib.parse import quote, urlencode

from django.conf import settings
from django.db import connection
from django.test import Client

from core.streams.reading import newest
from races.web.spectator_links import COOKIE
from tests.evaluation.processes import wait_for
from tests.shared import CHECKOUT

BACKEND = "django.contrib.auth.backends.ModelBackend"


class Streams:
    """``python -m config.streams`` with a port of its own. ``data``: its folder, with the socket of handed over
    connections; ``bell``: the address of a Valkey."""

    def __init__(self, data: Path, bell: str, **environment: str) -> None:
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PADDOCK_", "DATABASE_URL"))}
        self.environment = kept | {
            "DJANGO_SETTINGS_MODULE": "config.settings",
            "PADDOCK_DATA": str(data),
            "PADDOCK_SECRET_KEY": settings.SECRET_KEY,
            "DATABASE_URL": database_url(),
            "CACHE_URL": bell,
            **environment,
        }
        self.log = data.parent / f"{data.name}-streams.log"
        self.port = free_port()
        self.process: subprocess.Popen | None = None

    def start(self) -> None:
        command = [sys.executable, "-m", "config.streams", "--port", str(self.port)]
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(
                command, cwd=CHECKOUT, env=self.environment, stdout=output, stderr=subprocess.STDOUT
            )
        wait_for(lambda: self.figures() is not None, 60, self.log)

    def end(self, signum: int = signal.SIGTERM) -> int:
        assert self.process is not None
        self.process.send_signal(signum)
        status = self.process.wait(20)
        self.process = None
        return status

    def figures(self) -> dict[str, Any] | None:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/stream/health", timeout=5) as answer:
                return json.loads(answer.read())
        except OSError:
            return None

    def is_up_to_date(self) -> bool:
        """Whether it has read the table as it stands: the one of the test before may have been another."""
        found = self.figures()
        return found is not None and found["position"] == newest()


@dataclass
class Told:
    """A message: ``event``, ``id`` and ``data`` of it."""

    event: str = "message"
    id: str = ""
    data: dict[str, Any] = field(default_factory=dict)


class Listener:
    """An open stream. ``racer``: whose browser it is; None: a guest's."""

    def __init__(
        self,
        port: int,
        *topics: str,
        racer: Any = None,
        last: str = "",
        header: str = "",
        cookie: str = "",
        spectator: str = "",
    ) -> None:
        query = [("of", topic) for topic in topics] + ([("last", last)] if last else [])
        self.session = cookie or session_of(racer)
        lines = [f"GET /stream/?{urlencode(query)} HTTP/1.1", f"Host: 127.0.0.1:{port}"]
        cookies = {settings.SESSION_COOKIE_NAME: self.session, COOKIE: spectator}
        if sent := "; ".join(f"{name}={value}" for name, value in cookies.items() if value):
            lines.append(f"Cookie: {sent}")
        if header:
            lines.append(f"Last-Event-ID: {header}")
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=15)
        self._socket.sendall("\r\n".join([*lines, "", ""]).encode())
        self._read = b""
        self._body = b""
        head = self._until(b"\r\n\r\n")
        self.status = int(head.split()[1])
        self.head = head.decode().lower()
        self.is_chunked = "chunked" in self.head
        if not self.is_chunked:
            self._body, self._read = self._read, b""
        self.is_over = False

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, *exc: object) -> None:
        self._socket.close()

    def next(self, within_s: float = 10.0) -> Told | None:
        """The next message that is no sign of life; None when there is none in time, or the stream has ended."""
        until = monotonic() + within_s
        while not self.is_over and (left := until - monotonic()) > 0:
            if b"\n\n" in self._body:
                told = self._parse()
                if told.event not in ("beat",) and (told.data or told.event != "message"):
                    return told
                continue
            self._socket.settimeout(left)
            try:
                self._body += self._chunk()
            except TimeoutError:
                return None
            except (ConnectionError, EOFError):
                self.is_over = True
        return None

    def hello(self) -> Listener:
        """Wait until it has begun."""
        told = self.next()
        assert told is not None and told.event == "hello", told
        return self

    def _parse(self) -> Told:
        block, self._body = self._body.split(b"\n\n", 1)
        told = Told()
        for line in block.decode().split("\n"):
            name, _, value = line.partition(": ")
            if name == "data":
                told.data = json.loads(value)
            elif name in ("id", "event"):
                setattr(told, name, value)
        return told

    def _chunk(self) -> bytes:
        if not self.is_chunked:
            return self._more()
        size = int(self._until(b"\r\n"), 16)
        if not size:
            raise EOFError
        while len(self._read) < size + 2:
            self._read += self._more()
        chunk, self._read = self._read[:size], self._read[size + 2 :]
        return chunk

    def _until(self, mark: bytes) -> bytes:
        while mark not in self._read:
            self._read += self._more()
        found, self._read = self._read.split(mark, 1)
        return found

    def _more(self) -> bytes:
        more = self._socket.recv(65536)
        if not more:
            raise EOFError
        return more


def session_of(racer: Any) -> str:
    """A session of the racer's browser; empty for a guest."""
    if racer is None:
        return ""
    client = Client()
    client.force_login(racer, backend=BACKEND)
    return client.cookies[settings.SESSION_COOKIE_NAME].value


def database_url() -> str:
    told = connection.settings_dict
    if connection.vendor == "sqlite":
        return f"sqlite:///{told['NAME']}"
    host = quote(str(told["HOST"]), safe="")
    return f"postgres://{told['USER']}:{told['PASSWORD']}@{host}:{told['PORT']}/{told['NAME']}"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def served(streams: Streams) -> Iterator[int]:
    """A web server in the same folder, which hands streams over; yields its port."""
    port = free_port()
    command = [sys.executable, "-m", "config.web", "--port", str(port), "--processes", "1"]
    with streams.log.open("ab") as output:
        process = subprocess.Popen(
            command, cwd=CHECKOUT, env=streams.environment, stdout=output, stderr=subprocess.STDOUT
        )

    def lives() -> bool:
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/health/live", timeout=5).close()
        except OSError:
            return False
        return True

    try:
        wait_for(lives, 60, streams.log)
        yield port
    finally:
        process.terminate()
        process.wait(20)
