"""The web server, really started: slow connections, large bodies, ends and restarts."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from benchmarks import slow
from config.serving.web import listen
from tests.evaluation.processes import family_of, is_running, wait_for
from tests.servers import running
from tests.shared import CHECKOUT

pytestmark = pytest.mark.slow
# A fifth of the thousand that the benchmark holds open; a server with threads for connections has eight
SLOW = 200
MEGABYTE = 1024 * 1024


class Web:
    """A running server."""

    def __init__(self, process: subprocess.Popen, port: int) -> None:
        self.process, self.port = process, port
        self.address = f"http://127.0.0.1:{port}"

    def get(self, path: str, **headers: str) -> tuple[int, bytes]:
        return self.send(path, None, **headers)

    def send(self, path: str, body: bytes | None, **headers: str) -> tuple[int, bytes]:
        request = urllib.request.Request(self.address + path, body, headers)
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.read()

    def raw(self, request: bytes, *, whole: bool = False) -> bytes:
        """The first bytes that come back; the ``whole`` answer where the request asks to close after it."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=20) as connection:
            connection.sendall(request)
            if not whole:
                return connection.recv(65536)
            with connection.makefile("rb") as answer:
                return answer.read()

    def serving(self) -> set[int]:
        """The processes that serve."""
        return family_of(self.process.pid) - {self.process.pid}


@contextmanager
def web(application: str, *options: str) -> Iterator[Web]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "config.web", "--port", str(port), "--application", application, *options]

    def answers() -> bool:
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/health/live", timeout=5).close()
        except urllib.error.HTTPError:
            return True
        except OSError:
            return False
        return True

    with running(command, answers) as process:
        yield Web(process, port)


@pytest.fixture(scope="module")
def site(tmp_path_factory, new_data) -> Iterator[Web]:
    """The site itself, with nothing in its database."""
    data = new_data(tmp_path_factory.mktemp("web") / "data")
    patch = pytest.MonkeyPatch()
    patch.chdir(CHECKOUT)
    patch.setenv("PADDOCK_DATA", str(data))
    patch.setenv("DJANGO_SETTINGS_MODULE", "tests.config.web_settings")
    (data / "static").mkdir()
    with (data / "static" / "large").open("wb") as large:
        large.truncate(32 * MEGABYTE)
    try:
        with web("config.wsgi:application") as started:
            for _ in range(6):  # templates are read once, by each process
                started.get("/accounts/login/")
            yield started
    finally:
        patch.undo()


@pytest.fixture
def small(monkeypatch) -> Callable:
    """A site with a few views of its own (tests/config/web_site.py), in one process with one thread."""
    monkeypatch.chdir(CHECKOUT)
    return lambda *options: web("tests.config.web_site:application", *(options or ("--processes", "1")))


@pytest.fixture(scope="module")
def shared_small() -> Iterator[Web]:
    """One of those for tests that leave it as it was."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(CHECKOUT)
        with web("tests.config.web_site:application", "--processes", "1") as started:
            yield started


@pytest.mark.parametrize("kind", slow.KINDS)
def test_two_hundred_slow_connections_delay_nobody(site, kind):
    found = slow.measure(
        site.address, kind, SLOW, 0.8, page="/accounts/login/", file="/static/large", upload_mb=8, token="of nobody"
    ).shown()
    assert found["slow_connections"] == SLOW, "all of them were open at once"
    assert found["failed"] == 0
    assert found["health_p50_ms"] < 100, found
    assert found["page_p50_ms"] < 1000, found


def test_clients_that_read_nothing_block_no_thread(small):
    """One thread, and eight who ask for 32 MB without reading it: a file and an answer that is made as it goes."""
    with small("--processes", "1", "--threads", "1") as server:
        held = []
        for path in (b"/file", b"/made") * 4:
            connection = socket.create_connection(("127.0.0.1", server.port), timeout=20)
            connection.sendall(b"GET " + path + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            held.append(connection)
        started = time.monotonic()
        assert server.get("/health/live") == (200, b"ok")
        assert time.monotonic() - started < 5
        for connection in held:
            connection.close()


@pytest.mark.parametrize("path", [b"/file", b"/told"])
def test_an_answer_to_head_has_no_body(shared_small, path):
    with socket.create_connection(("127.0.0.1", shared_small.port), timeout=20) as connection:
        said = b"X-Forwarded-For: a\r\nX-Forwarded-Proto: b\r\nConnection: close\r\n\r\n"
        connection.sendall(b"HEAD " + path + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n" + said)
        with connection.makefile("rb") as answer:
            head, _, body = answer.read().partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200")
    assert body in (b"", b"0\r\n\r\n")  # the second is the end of one whose length nobody told


def test_a_large_upload_arrives_complete(shared_small):
    body = os.urandom(MEGABYTE) * 64
    status, told = shared_small.send("/api/length", body, Authorization="Token t")
    assert (status, told) == (200, str(len(body)).encode())


def test_a_chunked_body_arrives_complete_and_is_bounded(shared_small):
    head = b"POST /api/length HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n"
    closing = head.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n")
    answer = shared_small.raw(closing + b"5\r\nhello\r\n0\r\n\r\n", whole=True)
    assert answer.endswith(b"1\r\n5\r\n0\r\n\r\n")
    too_much = b"%X\r\n" % (6 * MEGABYTE) + bytes(6 * MEGABYTE)
    assert shared_small.raw(head + too_much).startswith(b"HTTP/1.1 413")


@pytest.mark.parametrize(
    ("path", "header"),
    [
        (b"/accounts/login/", b"Cookie: sessionid=x"),  # takes no models
        (b"/api/v1/models/", b"X-None: 1"),  # nobody's
    ],
)
def test_a_body_announced_as_too_large_is_refused_unread(site, path, header):
    """The answer comes though not a byte of the body was sent."""
    head = b"POST " + path + b" HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: multipart/form-data; boundary=b\r\n"
    answer = site.raw(head + header + b"\r\nContent-Length: %d\r\n\r\n" % (64 * MEGABYTE))
    assert answer.startswith((b"HTTP/1.1 413", b"HTTP/1.1 401", b"HTTP/1.1 403")), answer[:200]
    assert b"Connection: close" in answer


def test_concurrent_large_uploads_are_limited(small):
    with small() as server:
        head = b"POST /api/length HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Token t\r\n"
        held = []
        for _ in range(6):
            connection = socket.create_connection(("127.0.0.1", server.port), timeout=20)
            connection.sendall(head + b"Content-Length: %d\r\n\r\n" % (100 * MEGABYTE) + b"x")
            held.append(connection)
        time.sleep(0.3)
        answer = server.raw(head + b"Content-Length: %d\r\n\r\n" % (100 * MEGABYTE))
        assert answer.startswith(b"HTTP/1.1 503")
        assert server.get("/health/live") == (200, b"ok"), "everybody else is served"
        for connection in held:
            connection.close()


def test_proxy_headers_are_honoured(shared_small):
    told = shared_small.get("/told", **{"X-Forwarded-For": "203.0.113.7", "X-Forwarded-Proto": "https"})[1].decode()
    assert told == "203.0.113.7 https http 127.0.0.1"


def test_sigterm_finishes_requests_then_stops_everything(small):
    with small() as server:
        family = server.serving()
        connection = socket.create_connection(("127.0.0.1", server.port), timeout=20)
        connection.sendall(b"GET /slow HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        time.sleep(0.3)
        server.process.send_signal(signal.SIGTERM)
        with connection.makefile("rb") as answer:
            assert answer.read().endswith(b"7\r\nat last\r\n0\r\n\r\n"), "to its last byte"
        assert server.process.wait(30) == 0
        wait_for(lambda: not any(is_running(pid) for pid in family), 30)
        connection.close()


def test_a_dead_process_is_replaced_and_sighup_replaces_all(small):
    with small("--processes", "2") as server:
        first = server.serving()
        assert len(first) == 2
        os.kill(min(first), signal.SIGKILL)
        wait_for(lambda: len(server.serving() - {min(first)}) == 2, 10)
        second = server.serving()
        server.process.send_signal(signal.SIGHUP)
        wait_for(lambda: len(server.serving()) == 2 and not server.serving() & second, 10)
        assert server.get("/health/live") == (200, b"ok")


def test_sighup_brings_new_code_of_what_the_supervisor_has_loaded_too(tmp_path, monkeypatch):
    monkeypatch.chdir(CHECKOUT)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "sitecustomize.py").write_text("import release")
    (tmp_path / "releases.py").write_text(
        "import release, tests.config.web_site\n"
        "def application(environ, start_response):\n"
        "    start_response('200 OK', [])\n"
        "    return [release.NAME]\n"
    )
    (tmp_path / "release.py").write_text("NAME = b'old'")
    with web("releases:application", "--processes", "1") as server:
        assert server.get("/") == (200, b"old")
        (tmp_path / "release.py").write_text("NAME = b'newer'")
        server.process.send_signal(signal.SIGHUP)
        wait_for(lambda: server.get("/") == (200, b"newer"), 20)


def test_sigkill_ends_the_child_processes_too(small):
    with small() as server:
        family = server.serving()
        server.process.kill()
        wait_for(lambda: not any(is_running(pid) for pid in family), 10)


def test_a_killed_server_can_be_started_again_at_once(small):
    """Its child process finishes a request meanwhile, and holds the port no longer."""
    with small() as server:
        connection = socket.create_connection(("127.0.0.1", server.port), timeout=20)
        connection.sendall(b"GET /slow HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        time.sleep(0.3)
        server.process.kill()
        server.process.wait()
        wait_for(lambda: is_free(server.port), 0.5)
        with connection.makefile("rb") as answer:
            assert answer.read().endswith(b"7\r\nat last\r\n0\r\n\r\n"), "to its last byte"


def test_a_server_killed_while_it_loads_leaves_no_process(monkeypatch, tmp_path):
    (tmp_path / "loads_for_long.py").write_text("import time\nprint('loading', flush=True)\ntime.sleep(60)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = ["--port", str(port), "--processes", "1", "--application", "loads_for_long:application"]
    command = [sys.executable, "-m", "config.web", *options]
    with subprocess.Popen(command, cwd=CHECKOUT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline().endswith("- loading\n")
        family = family_of(process.pid)
        process.kill()
        wait_for(lambda: not any(is_running(pid) for pid in family), 30)
        assert is_free(port)


def is_free(port: int) -> bool:
    try:
        listen("127.0.0.1", port).close()
    except OSError:
        return False
    return True


def test_a_site_that_fails_to_load_ends_the_server(tmp_path: Path):
    command = [sys.executable, "-m", "config.web", "--port", "0", "--application", "tests.config.no_such_site:a"]
    ended = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, timeout=30)
    assert ended.returncode == os.EX_CONFIG
    assert "no_such_site" in ended.stdout
