"""Sends a question to a model's process and reads its answer in one call into C (paddock/simulator/exchange.c)."""

import ctypes
from collections.abc import Callable

from paddock.network.policy_wire import WAYS


class Exchange(ctypes.Structure):
    """``struct exchange``: the pipes, the budget, what was used of it, and what came of the last step."""

    step_deadline_s: float
    total_s: float
    bank_s: float  # what is left of the time above the deadline of a step
    seconds: float  # of all steps
    counts: ctypes.Array[ctypes.c_int64]  # of steps, by their way
    step: int
    best: int  # of the last answer, where all went well: the place of the first of the greatest numbers
    sent: int  # bytes of the request
    received: int  # bytes of the reply, which are the first of ``room``
    started_s: float  # by time.monotonic
    left_s: float  # from then on

    _fields_ = [
        ("_write_fd", ctypes.c_int32),
        ("_read_fd", ctypes.c_int32),
        ("_reply", ctypes.c_void_p),
        ("_reply_size", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("step_deadline_s", "total_s", "bank_s", "seconds")),
        ("counts", ctypes.c_int64 * len(WAYS)),
        *((name, ctypes.c_uint32) for name in ("step", "_unused")),
        *((name, ctypes.c_int64) for name in ("best", "sent", "received")),
        *((name, ctypes.c_double) for name in ("started_s", "left_s")),
    ]

    def __init__(self, read_fd: int, write_fd: int, reply_size: int) -> None:
        self.room = bytearray(reply_size + 1)
        # it stays where it is as long as this is there
        self._lent = (ctypes.c_ubyte * len(self.room)).from_buffer(self.room)
        super().__init__(write_fd, read_fd, ctypes.addressof(self._lent), reply_size)

    def call(self, library: ctypes.CDLL | None) -> Callable[[int], int] | None:
        """The C function that takes the address of this, sends the next step and returns the way in which it was
        answered, or -1 where Python must look at the reply. None where the library has no such function."""
        if library is None or not hasattr(library, "paddock_exchange"):
            return None
        function = library.paddock_exchange
        function.argtypes, function.restype = (ctypes.c_void_p,), ctypes.c_int64
        return function
