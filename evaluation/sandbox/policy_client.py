"""The referee's end of a model's pipes: observations out, one finite action back, within a budget of time."""

import ctypes
import math
import os
import select
import struct
import time
from collections.abc import Callable, Mapping, Sequence
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
    PolicyHeader,
    observation_bytes,
    observations_in,
    observations_of,
    reply_buffer,
)
from paddock.simulator import compiled

from .exchange import Exchange
from .limits import POLICY_S
from .observation_memory import fits

STEP_DEADLINE_S = 1.0
OVERAGE_S = 10.0
TOTAL_S = float(POLICY_S)


class PolicyClient:
    """Callable as a policy: ``dict`` of sensor arrays in, ``float32[n]`` out (a fresh array each time).

    A step may take ``step_deadline_s``; what is above comes from a bank of ``overage_s`` for the whole run (Kaggle's
    rule), and all steps together may take ``total_s``. ``before_first``, if set, is called before the first request;
    its time is not the network's. ``memory``: that of :mod:`.observation_memory`, if the model's process has it;
    ``places`` are then the arrays in it, one for each sensor. A call with that very dict copies nothing.

    Raises UserFault: ``policy_late``, ``policy_late_exact`` (most steps went the exact way), ``policy_died``,
    ``policy_protocol`` (anything but one reply to this step), ``non_finite_action``. After any of them the pipes are
    useless. A good exchange is one call into C where that is there (:mod:`.exchange`); this class handles the rest.
    """

    library: ClassVar[ctypes.CDLL | None] = compiled.library()

    def __init__(
        self,
        read_fd: int,
        write_fd: int,
        header: PolicyHeader,
        step_deadline_s: float = STEP_DEADLINE_S,
        overage_s: float = OVERAGE_S,
        total_s: float = TOTAL_S,
        memory: Buffer | None = None,
    ) -> None:
        self._read_fd, self._write_fd = read_fd, write_fd
        self._overage_s = overage_s
        self._sensors = observations_of(header)
        self.places = None if memory is None or not fits(header) else observations_in(header, memory)
        self._request_size = STEP.size + (observation_bytes(header) if self.places is None else 0)
        reply, action = reply_buffer(header)
        self._reply_size, self._reply_dtype = len(reply), action.dtype
        self._reply = struct.Struct(f"{REPLY.format}{action.size}f")
        self._account = account = Exchange(read_fd, write_fd, self._reply_size)
        account.step_deadline_s, account.bank_s, account.total_s = step_deadline_s, overage_s, total_s
        self._at, self._call = ctypes.addressof(account), None if self.places is None else account.call(self.library)
        self.address = 0 if self._call is None else self._at  # for a caller in C, once the first step is over
        self._readable, self._writable = select.poll(), select.poll()
        self._readable.register(read_fd, select.POLLIN)
        self._writable.register(write_fd, select.POLLOUT)
        for fd in (read_fd, write_fd):
            if os.get_blocking(fd):  # the launcher's ends are not, and a locked process may not change them
                os.set_blocking(fd, False)
        self.before_first: Callable[[], None] = lambda: None

    @property
    def step(self) -> int:
        return self._account.step

    @property
    def seconds(self) -> float:
        return self._account.seconds

    @property
    def counts(self) -> dict[int, int]:
        """Steps by the way they were answered, see :data:`paddock.network.policy_wire.WAYS`."""
        return dict(zip(WAYS, self._account.counts, strict=True))

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.array(self.ask(observation), self._reply_dtype)

    def ask(self, observation: Mapping[str, np.ndarray]) -> list[float]:
        """One step. ``observation`` must have exactly the header's sensors, dtypes and shapes (else ValueError)."""
        values = self._asked(observation)
        return self.answer() if values is None else values

    def answer(self) -> list[float]:
        """The answer of the last step, which C holds."""
        return list(self._reply.unpack_from(self._account.room)[2:])

    def choose(self, observation: Mapping[str, np.ndarray]) -> int:
        """The same where only the place of the first of the greatest numbers is of interest."""
        values = self._asked(observation)
        return self._account.best if values is None else values.index(max(values))

    def _asked(self, observation: Mapping[str, np.ndarray]) -> list[float] | None:
        """The answer; None where the C library holds it."""
        account = self._account
        if not account.step:
            self.before_first()
        shown = observation is self.places
        parts = [] if shown else self._parts(observation)
        if self._call is None:
            account.step += 1
            account.left_s = min(account.total_s - account.seconds, account.step_deadline_s + account.bank_s)
            account.started_s = time.monotonic()
            account.sent = account.received = 0
        elif self._call(self._at) >= 0:
            return None
        return self.answer_by_hand(parts)

    def answer_by_hand(self, parts: Sequence[Any] = ()) -> list[float]:
        """The answer where C left it to Python. ``parts``: of the observation, where no memory shows it."""
        account = self._account
        values = self._by_hand([STEP.pack(account.step), *parts])
        taken = time.monotonic() - account.started_s
        account.seconds += taken
        if taken > account.step_deadline_s:
            account.bank_s -= taken - account.step_deadline_s
        return values

    def _by_hand(self, parts: list[Any]) -> list[float]:
        """The answer by Python, from the current state of the exchange."""
        account = self._account
        if not account.sent:
            self._send(parts)
        # What C sent is small and whole, or nothing.
        return self._checked(self._receive(bytes(account.room[: account.received])))

    def _parts(self, observation: Mapping[str, np.ndarray]) -> list[Any]:
        """The parts of an observation for the pipe, which the kernel concatenates; none where memory shows it."""
        places = self.places
        if len(observation) != len(self._sensors):
            raise self._disagreed(observation)
        parts: list[Any] = []
        for name, dtype, shape in self._sensors:
            value = observation.get(name)
            if value is None:
                raise self._disagreed(observation)
            if value.shape != shape or value.dtype != dtype:
                raise ValueError(f"{name}: {value.dtype}{value.shape} where {dtype}{shape} was agreed")
            if places is not None:
                places[name][...] = value
                continue
            parts.append(value if value.flags.c_contiguous else np.ascontiguousarray(value))
        return parts

    def _disagreed(self, observation: Mapping[str, np.ndarray]) -> ValueError:
        agreed = [name for name, _, _ in self._sensors]
        return ValueError(f"sensors {sorted(observation)} where {agreed} were agreed")

    def _send(self, parts: list[Any]) -> None:
        try:
            written = os.writev(self._write_fd, parts)
        except BlockingIOError:
            written = 0
        except BrokenPipeError:
            raise self._died() from None
        if written == self._request_size:  # as good as always: the pipe holds many requests
            return
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
        try:
            # One byte more than wanted, to see a second reply that comes with the first.
            chunk = os.read(self._read_fd, self._reply_size + 1)
        except BlockingIOError:
            return b""
        if not chunk:
            raise self._died()
        return chunk

    def _receive(self, reply: bytes) -> bytes:
        while len(reply) < self._reply_size:
            self._wait(self._readable)
            reply += self._read()
        if len(reply) > self._reply_size:
            raise UserFault("policy_protocol", step=self.step)
        return reply

    def _checked(self, reply: bytes) -> list[float]:
        step, way, *values = self._reply.unpack(reply)
        if step != self.step or way not in WAYS:
            raise UserFault("policy_protocol", step=self.step)
        self._account.counts[way] += 1
        # a sum of finite ones is finite: float32 is far from what a float64 holds
        if not math.isfinite(sum(values)):
            raise UserFault("non_finite_action", step=self.step)
        return values

    def _wait(self, poller: select.poll) -> None:
        account = self._account
        # Looked at once in any case: if this process was not scheduled in time, that is not the network's slowness.
        left = max(0.0, account.started_s + account.left_s - time.monotonic())
        if not poller.poll(left * 1000):
            exact = account.counts[EXACT] + account.counts[EXCEEDED]
            raise UserFault(
                "policy_late_exact" if 2 * exact > account.step else "policy_late",
                step=account.step,
                exact=exact,
                step_s=account.step_deadline_s,
                overage_s=self._overage_s,
                total_s=account.total_s,
                waited_s=round(account.seconds + time.monotonic() - account.started_s, 3),
            )

    def _died(self) -> UserFault:
        return UserFault("policy_died", step=self.step, how="closed its pipes")
