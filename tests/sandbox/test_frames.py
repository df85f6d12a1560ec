"""Frames: bounded in size and in time, whoever sits at the other end."""

from __future__ import annotations

import contextlib
import json
import os
import struct
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.sandbox.frames import (
    FrameClosed,
    FrameError,
    FrameMalformed,
    FrameTimeout,
    FrameTooLarge,
    read_frame,
    read_message,
    write_frame,
    write_message,
)


@pytest.fixture
def pipe():
    read, write = os.pipe()
    ends = {read, write}
    yield read, write
    for fd in ends:
        with contextlib.suppress(OSError):
            os.close(fd)


def soon(seconds=0.05):
    return time.monotonic() + seconds


def test_a_frame_comes_through_whole(pipe):
    read, write = pipe
    write_frame(write, b"hello")
    write_frame(write, b"")
    assert read_frame(read, 5) == b"hello"
    assert read_frame(read, 5) == b""


@pytest.mark.parametrize("blocking", [True, False])
def test_a_frame_larger_than_the_pipe_comes_through(pipe, blocking):
    read, write = pipe
    os.set_blocking(write, blocking)
    data = os.urandom(3_000_000)
    writer = threading.Thread(target=write_frame, args=(write, data, soon(10)))
    writer.start()
    assert read_frame(read, len(data), soon(10)) == data
    writer.join()


def test_an_oversized_frame_is_refused_before_its_body_is_read(pipe):
    read, write = pipe
    os.write(write, struct.pack("<I", 0xFFFFFFFF))
    with pytest.raises(FrameTooLarge):
        read_frame(read, 1000)


def test_a_stream_ending_within_a_frame_counts_as_closed(pipe):
    read, write = pipe
    os.write(write, struct.pack("<I", 10) + b"half")
    os.close(write)
    with pytest.raises(FrameClosed):
        read_frame(read, 100)


@pytest.mark.parametrize("sent", [b"", b"\x01", struct.pack("<I", 10), struct.pack("<I", 10) + b"half"])
def test_waiting_for_the_rest_of_a_frame_ends_at_the_deadline(pipe, sent):
    read, write = pipe
    os.write(write, sent)
    with pytest.raises(FrameTimeout):
        read_frame(read, 100, soon())


def test_a_trickle_of_bytes_does_not_extend_the_deadline(pipe):
    read, write = pipe
    stop = threading.Event()

    def drip():
        os.write(write, struct.pack("<I", 1000))
        while not stop.wait(0.005):
            os.write(write, b"x")

    dripper = threading.Thread(target=drip)
    dripper.start()
    started = time.monotonic()
    with pytest.raises(FrameTimeout):
        read_frame(read, 1000, soon(0.1))
    stop.set()
    dripper.join()
    assert time.monotonic() - started < 4  # all of it would take 5 s


@pytest.mark.parametrize("blocking", [True, False])
def test_writing_to_a_peer_that_never_reads_times_out(pipe, blocking):
    _, write = pipe
    os.set_blocking(write, blocking)
    with pytest.raises(FrameTimeout):
        write_frame(write, bytes(1_000_000), soon())


def test_writing_to_a_peer_that_is_gone_counts_as_closed(pipe):
    read, write = pipe
    os.close(read)
    with pytest.raises(FrameClosed):
        write_frame(write, b"x")


def test_a_message_carries_its_blobs(pipe):
    read, write = pipe
    write_message(write, {"a": [1, "b"]}, [b"one", b""])
    assert read_message(read) == ({"a": [1, "b"]}, [b"one", b""])


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"\xff",
        b"[]",
        b"1",
        b'{"a": NaN}',
        b'{"blobs": 1}',
        b'{"blobs": [-1]}',
        b'{"blobs": [true]}',
        b'{"blobs": [1.5]}',
        json.dumps({"blobs": [0] * 17}).encode(),
        b"[" * 100_000,
    ],
)
def test_anything_but_a_message_is_malformed(pipe, body):
    read, write = pipe
    threading.Thread(target=write_frame, args=(write, body)).start()
    with pytest.raises(FrameMalformed):
        read_message(read, soon(5))


def test_the_total_size_of_blobs_is_bounded(pipe):
    read, write = pipe
    write_frame(write, b'{"blobs": [600, 600]}')
    with pytest.raises(FrameTooLarge):
        read_message(read, soon(), blob_limit=1000)


def test_a_blob_of_an_unannounced_size_is_malformed(pipe):
    read, write = pipe
    write_frame(write, b'{"blobs": [6]}')
    write_frame(write, b"abc")
    with pytest.raises(FrameMalformed):
        read_message(read, soon())


def test_a_non_finite_number_is_not_sent(pipe):
    with pytest.raises(ValueError):
        write_message(pipe[1], {"a": float("nan")})


@given(st.binary(max_size=4000))
def test_any_bytes_give_a_frame_or_a_frame_error(data):
    read, write = os.pipe()
    try:
        os.write(write, data)
        os.close(write)
        with contextlib.suppress(FrameError):
            read_message(read, soon(5), json_limit=2000, blob_limit=2000)
    finally:
        os.close(read)
