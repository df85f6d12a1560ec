"""Requests that can be read in two ways are refused with 400, and nothing behind them is read."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Iterator

import pytest

from tests.config.framed_requests import CHUNKED, CHUNKS, FINE, HEADS, HOST
from tests.config.test_web import Web, web
from tests.shared import CHECKOUT

pytestmark = pytest.mark.slow
SECOND = b"GET /health/live HTTP/1.1\r\n" + HOST + b"\r\n"
CLOSING = SECOND.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n")
COUNTED = CHUNKED.replace(b"/length", b"/counted")


@pytest.fixture(scope="module")
def server() -> Iterator[Web]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(CHECKOUT)
        with web("tests.config.web_site:application", "--processes", "1") as started:
            yield started


def answers(port: int, *pieces: bytes, pause_s: float = 0.0, stops_early: bool = True) -> bytes:
    """All that comes back until the server closes the connection. ``stops_early``: send no more after an answer."""
    received = b""
    with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
        try:
            for piece in pieces:
                if stops_early and select.select([connection], [], [], pause_s)[0]:
                    break  # it has answered, and reads no more
                connection.sendall(piece)
            while more := connection.recv(65536):
                received += more
        except ConnectionError:  # it closed with unread bytes
            pass
    return received


def assert_refused(received: bytes, name: str) -> None:
    assert received.count(b"HTTP/1.1 ") + received.count(b"HTTP/1.0 ") == 1, (name, received)
    assert received.split(b" ", 2)[1] == b"400", (name, received)
    assert b"connection: close" in received.lower(), (name, received)


@pytest.mark.parametrize("name", HEADS)
def test_an_ambiguous_head_is_refused_and_closes(server, name):
    head = HEADS[name].replace(b"{path}", b"/api/length")
    assert_refused(answers(server.port, head + SECOND), name)


@pytest.mark.parametrize("name", CHUNKS)
def test_malformed_chunks_are_refused_and_close(server, name):
    assert_refused(answers(server.port, CHUNKED + CHUNKS[name] + SECOND), name)


@pytest.mark.parametrize("name", ["bare LF", "both lengths", "a folded line", "a bare CR", "TLS", "CR CR LF"])
def test_a_head_in_pieces_is_refused_as_well(server, name):
    head = HEADS[name].replace(b"{path}", b"/api/length")
    pieces = [head[at : at + 7] for at in range(0, len(head), 7)]
    assert_refused(answers(server.port, *pieces, pause_s=0.005), name)


@pytest.mark.parametrize("name", ["a huge extension", "a size with a bare LF", "a trailer", "data that ends with LF"])
def test_chunks_in_pieces_are_refused_as_well(server, name):
    whole = CHUNKS[name][:2000]
    pieces = [CHUNKED, *(whole[at : at + 9] for at in range(0, len(whole), 9))]
    assert_refused(answers(server.port, *pieces, pause_s=0.002), name)


@pytest.mark.parametrize("name", FINE)
@pytest.mark.parametrize("size", [1, 3, 100_000])
def test_well_formed_chunks_are_read_and_the_next_request_is_answered(server, name, size):
    body, length = FINE[name]
    whole = COUNTED + body + CLOSING
    pieces = (whole[at : at + size] for at in range(0, len(whole), size))
    received = answers(server.port, *pieces, stops_early=False)
    assert received.count(b"HTTP/1.1 200 OK") == 2, received
    assert b"\r\n\r\n" + length + b"HTTP/1.1 200 OK" in received


def test_many_small_chunks_cost_little(server):
    """A megabyte in chunks of one byte."""
    began = time.monotonic()
    body = b"1\r\nx\r\n" * 175_000 + b"0\r\n\r\n"
    last = CHUNKED.replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n")
    assert b"175000" in answers(server.port, last + body)
    assert time.monotonic() - began < 10


@pytest.mark.parametrize("method", [b"GET", b"POST"])
def test_expecting_to_continue_with_nothing_is_answered(server, method):
    head = method + b" /api/counted HTTP/1.1\r\n" + HOST + b"Expect: 100-continue\r\n"
    received = answers(server.port, head + b"\r\n" + CLOSING)
    assert received.count(b"HTTP/1.1 200 OK") == 2, received


def test_a_body_too_large_is_not_continued(server):
    head = b"POST /api/length HTTP/1.1\r\n" + HOST + b"Expect: 100-continue\r\nContent-Length: 99999999999\r\n\r\n"
    received = answers(server.port, head + SECOND)
    assert received.count(b"HTTP/1.1 ") == 1 and b"100 Continue" not in received, received


def test_a_head_beyond_the_bound_is_refused(server):
    received = answers(server.port, b"GET / HTTP/1.1\r\n" + HOST + b"X: " + b"y" * 70_000 + b"\r\n\r\n" + SECOND)
    assert received.count(b"HTTP/1.1 ") + received.count(b"HTTP/1.0 ") <= 1
    assert not received or received.split(b" ", 2)[1] == b"431", received


@pytest.mark.parametrize("name", HEADS)
def test_an_ambiguous_head_of_a_stream_is_refused(server, name):
    head = HEADS[name].replace(b"{path}", b"/stream/?of=races")
    assert_refused(answers(server.port, head + SECOND), name)
