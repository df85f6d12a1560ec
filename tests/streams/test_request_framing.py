"""The streams refuse what the web server refuses, on a port of their own and handed over."""

from __future__ import annotations

import pytest

from tests.config.framed_requests import HEADS, HOST, get
from tests.config.test_request_framing import CLOSING, SECOND, answers, assert_refused
from tests.streams.process import served

pytestmark = [pytest.mark.slow, pytest.mark.django_db(transaction=True)]
CLOCK = b"/stream/clock"
BODIES = {
    "a body": get(b"Content-Length: 5", body=b"hello"),
    "a chunked body": get(b"Transfer-Encoding: chunked", body=b"5\r\nhello\r\n0\r\n\r\n"),
}


def test_the_port_of_the_streams_refuses_ambiguous_heads_and_bodies(process):
    for name, head in (HEADS | BODIES).items():
        assert_refused(answers(process.port, head.replace(b"{path}", CLOCK) + SECOND), name)
    in_pieces = [bytes([byte]) for byte in HEADS["bare LF"].replace(b"{path}", CLOCK)]
    assert_refused(answers(process.port, *in_pieces, pause_s=0.005), "in pieces")
    assert_refused(answers(process.port, b"GET /" + b"x" * 70_000), "too large")


def test_the_web_server_hands_no_ambiguous_head_over(process):
    with served(process) as port:
        for name, head in HEADS.items():
            assert_refused(answers(port, head.replace(b"{path}", CLOCK) + SECOND), name)
        for head in BODIES.values():  # not handed over: the site reads the body, and then the next request
            received = answers(port, head.replace(b"{path}", CLOCK) + CLOSING)
            assert received.count(b"HTTP/1.1 ") == 2 and received.endswith(b"ok\n"), received


def test_one_request_is_answered_and_what_follows_is_not_read(process):
    with served(process) as port:
        for at in (process.port, port):
            received = answers(at, get().replace(b"{path}", CLOCK) + get().replace(b"{path}", CLOCK))
            assert received.startswith(b"HTTP/1.1 200") and received.count(b"HTTP/1.1 ") == 1, received
            halves = b"GET " + CLOCK + b" HTTP/1.1\r\n", HOST + b"\r\n"
            assert answers(at, *halves, pause_s=0.05).startswith(b"HTTP/1.1 200")
