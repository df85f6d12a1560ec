"""The referee's end of a model's pipes: observations out, one finite action back, within a budget of time."""

from __future__ import annotations

import ctypes
import math
import os
import select
import struct
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from paddock.errors import UserFault
from paddock.network.policy_wire import (
    EXACT,
    EXCEEDED,
    REPLY,
    STEP,
    WAYS,
    Buffer,
    observation_bytes,
    observations_in,
    observations_of,
    reply_buffer,
)
from paddock.simulator import compiled

from .exchange import Exchange, exchange
from .limits import POLICY_S
from .shown import fits

STEP_DEADLINE_S = 1.0
OVERAGE_S = 10.0
TOTAL_S = float(POLICY_S)


class PolicyClient:
    """Callable as a policy: ``dict`` of sensor arrays in, ``float32[n]`` out (a fresh array each time). :meth:`ask` is
    the same and answers with the numbers alone.

    A step may take ``step_deadline_s``; what is above comes from a bank of ``overage_s`` for the whole run (Kaggle's
    rule), and all steps together may take ``total_s``. Slowness within that budget changes nothing but wall time.

    ``counts``: steps by the way they were answered, see :data:`paddock.network.policy_wire.WAYS`.

    Raises UserFault: ``policy_late``, ``policy_late_exact`` (the same where most steps went the exact way),
    ``policy_died``, ``policy_protocol`` (anything but one reply to this step), ``non_finite_action``. After any of them
    the pipes are of no use any more. ``seconds`` counts the time spent in it. ``before_first``, if it is set, is called
    before the first request; what it waits for is not the network's time. ``memory``: that of :mod:`.shown`, if the
    model's process has it; ``places`` are then the arrays in it that the model sees, one for each sensor. Whoever has
    filled them asks with that very dict, and nothing is copied.

    An exchange that goes well is one call into C where that is there (:mod:`.exchange`); whatever else happens is
    looked at here.
    """

    library: ClassVar[ctypes.CDLL | None] = compiled.load()

    def __init__(
        self,
        read_fd: int,
        write_fd: int,
        header: dict[str, Any],
        step_deadline_s: float = STEP_DEADLINE_S,
        overage_s: float = OVERAGE_S,
        total_s: float = TOTAL_S,
        memory: Buffer | None = None,
    ) -> None:
        self._read_fd, self._write_fd = read_fd, write_fd
        self._step_deadline_s, self._overage_s, self._total_s = step_deadline_s, overage_s, total_s
        self._bank = overage_s
        self._head = bytearray(STEP.size)
        self._sensors = observations_of(header)
        self.places = None if memory is None or not fits(header) else observations_in(header, memory)
        self._request_size = STEP.size + (observation_bytes(header) if self.places is None else 0)
        reply, action = reply_buffer(header)
        self._reply_size, self._reply_dtype = len(reply), action.dtype
        self._reply = struct.Struct(f"{REPLY.format}{action.size}f")
        self._answer = struct.Struct(f"<{action.size}f")
        self._in_c = None
        if self.places is not None:
            self._in_c = exchange(self.library, read_fd, write_fd, self._head, self._reply_size)
        self._readable, self._writable = select.poll(), select.poll()
        self._readable.register(read_fd, select.POLLIN)
        self._writable.register(write_fd, select.POLLOUT)
        for fd in (read_fd, write_fd):
            if os.get_blocking(fd):  # the launcher's ends are not, and a locked process may not change them
                os.set_blocking(fd, False)
        self._until = self._started = 0.0
        self.before_first: Callable[[], None] = lambda: None
        self.step = 0
        self.seconds = 0.0
        self.counts = dict.fromkeys(WAYS, 0)

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """:meth:`ask`, and the answer as an array."""
        return np.array(self.ask(observation), self._reply_dtype)

    def ask(self, observation: Mapping[str, np.ndarray]) -> list[float]:
        """One step. ``observation`` must have exactly the header's sensors, dtypes and shapes (else ValueError)."""
        if not self.step:
            self.before_first()
        parts = [self._head] if observation is self.places else self._parts(observation)
        self.step = step = self.step + 1
        STEP.pack_into(self._head, 0, step)
        left_s, most_s = self._total_s - self.seconds, self._step_deadline_s + self._bank
        if left_s > most_s:
            left_s = most_s
        if self._in_c is None:
            values, taken = self._asked(parts, left_s)
        else:
            exchanged, call, at = self._in_c
            way = call(at, left_s)
            if way < 0:
                values, taken = self._gone_on(exchanged, parts, left_s)
            else:
                self.counts[way] += 1
                values, taken = list(self._answer.unpack_from(exchanged.room, REPLY.size)), exchanged.taken_s
        self.seconds += taken
        if taken > self._step_deadline_s:
            self._bank -= taken - self._step_deadline_s
        return values

    def _asked(self, parts: list[Any], left_s: float) -> tuple[list[float], float]:
        """The answer, and the seconds that it took."""
        self._started = time.monotonic()
        self._until = self._started + left_s
        if not self._send(parts):
            left_s = self._until - time.monotonic()
        # Looked at once in any case, see _wait.
        reply = self._read() if self._readable.poll(left_s * 1000 if left_s > 0.0 else 0) else b""
        values = self._checked(reply if len(reply) == self._reply_size else self._receive(reply))
        return values, time.monotonic() - self._started

    def _gone_on(self, exchanged: Exchange, parts: list[Any], left_s: float) -> tuple[list[float], float]:
        """The same from where C left off."""
        self._started = exchanged.started_s
        self._until = self._started + left_s
        if exchanged.sent < self._request_size:
            self._send_rest(parts, exchanged.sent)
        values = self._checked(self._receive(bytes(exchanged.room[: exchanged.received])))
        return values, time.monotonic() - self._started

    def _parts(self, observation: Mapping[str, np.ndarray]) -> list[Any]:
        """A request, which the kernel puts together: the arrays go into the pipe from where they are, unless they are
        shown in memory."""
        shown = self.places
        if len(observation) != len(self._sensors):
            raise self._disagreed(observation)
        parts: list[Any] = [self._head]
        for name, dtype, shape in self._sensors:
            value = observation.get(name)
            if value is None:
                raise self._disagreed(observation)
            if value.shape != shape or value.dtype != dtype:
                raise ValueError(f"{name}: {value.dtype}{value.shape} where {dtype}{shape} was agreed")
            if shown is not None:
                shown[name][...] = value
                continue
            parts.append(value if value.flags.c_contiguous else np.ascontiguousarray(value))
        return parts

    def _disagreed(self, observation: Mapping[str, np.ndarray]) -> ValueError:
        agreed = [name for name, _, _ in self._sensors]
        return ValueError(f"sensors {sorted(observation)} where {agreed} were agreed")

    def _send(self, parts: list[Any]) -> bool:
        """Whether it went out at once."""
        try:
            written = os.writev(self._write_fd, parts)
        except BlockingIOError:
            written = 0
        except BrokenPipeError:
            raise self._died() from None
        if written == self._request_size:  # as good as always: the pipe holds many requests
            return True
        self._send_rest(parts, written)
        return False

    def _send_rest(self, parts: list[Any], written: int) -> None:
        """What is left of a request of which so many bytes are on their way."""
        left = memoryview(b"".join(parts))[written:]
        while left:
            self._wait(self._writable)
            try:
                left = left[os.write(self._write_fd, left) :]
            except BlockingIOError:
                continue
            except BrokenPipeError:
                raise self._died() from None

    def _read(self) -> bytes:
        """What there is of a reply; raises UserFault where the pipe is closed."""
        try:
            # One byte more than wanted, to see a second reply that comes with the first.
            chunk = os.read(self._read_fd, self._reply_size + 1)
        except BlockingIOError:
            return b""
        if not chunk:
            raise self._died()
        return chunk

    def _receive(self, reply: bytes) -> bytes:
        """The rest of a reply that did not come in one piece."""
        while len(reply) < self._reply_size:
            self._wait(self._readable)
            reply += self._read()
        if len(reply) > self._reply_size:
            raise UserFault("policy_protocol", step=self.step)
        return reply

    def _checked(self, reply: bytes) -> list[float]:
        step, way, *values = self._reply.unpack(reply)
        if step != self.step or way not in self.counts:
            raise UserFault("policy_protocol", step=self.step)
        self.counts[way] += 1
        # a sum of finite ones is finite: float32 is far from what a float64 holds
        if not math.isfinite(sum(values)):
            raise UserFault("non_finite_action", step=self.step)
        return values

    def _wait(self, poller: select.poll) -> None:
        # Looked at once in any case: if this process was not scheduled in time, that is not the network's slowness.
        left = max(0.0, self._until - time.monotonic())
        if not poller.poll(left * 1000):
            exact = self.counts[EXACT] + self.counts[EXCEEDED]
            raise UserFault(
                "policy_late_exact" if 2 * exact > self.step else "policy_late",
                step=self.step,
                exact=exact,
                step_s=self._step_deadline_s,
                overage_s=self._overage_s,
                total_s=self._total_s,
                waited_s=round(self.seconds + time.monotonic() - self._started, 3),
            )

    def _died(self) -> UserFault:
        return UserFault("policy_died", step=self.step, how="closed its pipes")
