"""Length-prefixed, bounded frames over pipes, for set-up and control.

A frame is a little-endian ``uint32`` length and that many bytes. A message is a frame of JSON, followed by one frame
for each binary blob whose size its ``"blobs"`` list names. The sender may be hostile: every read is bounded in size
and, if wanted, in time.
"""

import io
import json
import os
import select
import struct
import time
from collections.abc import Mapping, Sequence
from typing import Any

LENGTH = struct.Struct("<I")
LOCKED = {"state": "locked"}  # the first message of a process that is locked
MAX_JSON = 4 * 1024 * 1024
MAX_BLOB = 64 * 1024 * 1024
MAX_NETWORK = 1024 * 1024 * 1024  # in a locked process, which has its network from us and its memory bounded
_READ_CHUNK = 1024 * 1024
_SHORT = 64 * 1024
_PIPE_BUF = 4096  # Linux: a pipe that polls writable takes this much without blocking


class FrameError(Exception):
    """Something is wrong with the frame or the pipe."""


class FrameClosed(FrameError):
    """The other end closed the pipe (or died) before the frame was complete."""


class FrameTimeout(FrameError):
    """The deadline passed before the frame was complete."""


class FrameTooLarge(FrameError):
    """The announced length is above the limit; the frame's body was not read."""


class FrameMalformed(FrameError):
    """The bytes do not form a message."""


def write_frame(fd: int, data: bytes | bytearray | memoryview, deadline: float | None = None) -> None:
    """Write one frame before ``deadline`` (``time.monotonic()``; None: no limit). Raises FrameClosed, FrameTimeout."""
    view = memoryview(data).cast("B")
    length = LENGTH.pack(len(view))
    if len(view) <= _SHORT:  # in one piece: the reader wakes up once
        _write_all(fd, memoryview(length + bytes(view)), deadline)
    else:
        _write_all(fd, memoryview(length), deadline)
        _write_all(fd, view, deadline)


def read_frame(fd: int, limit: int, deadline: float | None = None) -> bytes:
    """Read one frame of at most ``limit`` bytes. Raises FrameClosed, FrameTooLarge, FrameTimeout."""
    (length,) = LENGTH.unpack(_read_exactly(fd, LENGTH.size, deadline))
    if length > limit:
        raise FrameTooLarge(f"a frame of {length} bytes, {limit} allowed")
    return _read_exactly(fd, length, deadline)


def write_message(
    fd: int, header: Mapping[str, object], blobs: Sequence[bytes] = (), deadline: float | None = None
) -> None:
    """Write ``header`` as JSON and the blobs after it. Floats must be finite."""
    announced = {**header, "blobs": [len(blob) for blob in blobs]} if blobs else header
    write_frame(fd, json.dumps(announced, allow_nan=False, separators=(",", ":")).encode(), deadline)
    for blob in blobs:
        write_frame(fd, blob, deadline)


def read_message(
    fd: int, deadline: float | None = None, *, json_limit: int = MAX_JSON, blob_limit: int = MAX_BLOB
) -> tuple[dict[str, Any], list[bytes]]:
    """Read what :func:`write_message` wrote: ``(header without "blobs", blobs)``. ``blob_limit`` bounds the sum of all
    blobs. Raises FrameMalformed, and what :func:`read_frame` raises."""
    header = parse_header(read_frame(fd, json_limit, deadline))
    sizes = blob_sizes(header, blob_limit)
    return header, [_blob(fd, size, deadline) for size in sizes]


def parse_header(data: bytes) -> dict[str, Any]:
    """The JSON object in ``data``. Raises FrameMalformed (also for NaN, for depth, for a list)."""
    try:
        header = json.loads(data, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise FrameMalformed(f"not JSON: {error}") from None
    if not isinstance(header, dict):
        raise FrameMalformed("not a JSON object")
    return header


def blob_sizes(header: dict[str, object], limit: int = MAX_BLOB) -> list[int]:
    """Take ``"blobs"`` out of ``header``. Raises FrameMalformed, FrameTooLarge."""
    sizes = header.pop("blobs", [])
    if not isinstance(sizes, list) or len(sizes) > 16 or not all(type(size) is int and size >= 0 for size in sizes):
        raise FrameMalformed("'blobs' is not a short list of sizes")
    if sum(sizes) > limit:
        raise FrameTooLarge(f"blobs of {sum(sizes)} bytes, {limit} allowed")
    return sizes


def _blob(fd: int, size: int, deadline: float | None) -> bytes:
    blob = read_frame(fd, size, deadline)
    if len(blob) != size:
        raise FrameMalformed(f"a blob of {len(blob)} bytes where {size} were announced")
    return blob


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


def _read_exactly(fd: int, count: int, deadline: float | None) -> bytes:
    taken = io.BytesIO()  # gives its bytes away without a copy, which a list of parts does not
    left = count
    while left:
        wait_for(fd, select.POLLIN, deadline)
        try:
            chunk = os.read(fd, min(left, _READ_CHUNK))
        except BlockingIOError:
            continue
        if not chunk:
            raise FrameClosed(f"the stream ended {left} bytes before the end of {count}")
        taken.write(chunk)
        left -= len(chunk)
    return taken.getvalue()


def _write_all(fd: int, view: memoryview, deadline: float | None) -> None:
    # A blocking pipe takes PIPE_BUF at a time so that no write can outlast the deadline; a non-blocking one takes all.
    chunk = len(view) if deadline is None or not os.get_blocking(fd) else _PIPE_BUF
    while view:
        wait_for(fd, select.POLLOUT, deadline)
        try:
            written = os.write(fd, view[:chunk])
        except BlockingIOError:
            continue
        except BrokenPipeError:
            raise FrameClosed("nobody reads this pipe any more") from None
        view = view[written:]


def wait_for(fd: int, event: int, deadline: float | None) -> None:
    """Return when ``fd`` has ``event`` (or hung up). Raises FrameTimeout at the ``time.monotonic()`` deadline."""
    if deadline is None and os.get_blocking(fd):
        return
    poller = select.poll()
    poller.register(fd, event)
    while True:
        left = None if deadline is None else deadline - time.monotonic()
        if left is not None and left <= 0:
            raise FrameTimeout("the deadline passed")
        if poller.poll(None if left is None else left * 1000 + 1):
            return
