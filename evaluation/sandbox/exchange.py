"""A question to a model's process and its answer as one call into C (paddock/simulator/exchange.c), where that is
there."""

from __future__ import annotations

import ctypes
from collections.abc import Callable


class Exchange(ctypes.Structure):
    """``struct exchange``: where the request lies and the reply goes, and what came of the last call."""

    sent: int  # bytes of the request
    received: int  # bytes of the reply, which are the first of ``room``
    started_s: float  # by time.monotonic
    taken_s: float  # seconds, where all went well
    room: bytearray
    lent: list[ctypes.Array[ctypes.c_ubyte]]  # request and room, which stay where they are as long as this is there

    _fields_ = [
        ("_write_fd", ctypes.c_int32),
        ("_read_fd", ctypes.c_int32),
        ("_request", ctypes.c_void_p),
        ("_reply", ctypes.c_void_p),
        ("_reply_size", ctypes.c_int64),
        ("sent", ctypes.c_int64),
        ("received", ctypes.c_int64),
        ("started_s", ctypes.c_double),
        ("taken_s", ctypes.c_double),
    ]


def exchange(
    library: ctypes.CDLL | None, read_fd: int, write_fd: int, request: bytearray, reply_size: int
) -> tuple[Exchange, Callable[[int, float], int], int] | None:
    """What to look at, what to call and with which first argument; the second one is how many seconds the reply may
    take. It sends ``request``, the four bytes of a step, as they are then, and returns the way in which the step was
    answered, -1 where that is not all that is to be said. None where the library has no such function."""
    if library is None or not hasattr(library, "paddock_exchange"):
        return None
    room = bytearray(reply_size + 1)
    lent = [(ctypes.c_ubyte * len(buffer)).from_buffer(buffer) for buffer in (request, room)]
    made = Exchange(write_fd, read_fd, *map(ctypes.addressof, lent), reply_size)
    made.room, made.lent = room, lent
    call = library.paddock_exchange
    call.argtypes, call.restype = (ctypes.c_void_p, ctypes.c_double), ctypes.c_int64
    return made, call, ctypes.addressof(made)
