"""A model behind the wall: ``main`` runs in its own locked process, made by :class:`.policy.PolicyProcess`.

It says ``{"state": "locked"}``, reads a message with the canonical ONNX bytes and one with the header (two, so that the
network loads while the referee still starts), answers ``{"state": "ready"}`` or why not, and then answers the
fixed-size requests of :mod:`.policy_wire` until its input closes.

A model's input has the sensor's name and either the sensor's own layout (``[1, H, W, C]``) or channels first
(``[1, C, H, W]``); the observation is cast to the input's dtype and is not scaled.
"""

from __future__ import annotations

import ctypes
import math
import os
import select
from typing import Any

import numpy as np
import onnxruntime

from .frames import MAX_NETWORK, FrameClosed, read_message, write_message
from .lock import EXIT_MEMORY
from .policy_wire import STEP, reply_buffer, request_buffer

_DTYPES = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(uint8)": np.uint8,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
}


_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_MAX = -1, -2, -4  # malloc.h
_IDLE_MS = 100  # without a request for so long, there is time to prepare for one
_BLOCK, _BLOCKS = 4 << 20, 32  # bytes; in all what the largest network takes on its way into a session
_OPERATIONS = 1 << 16  # in the canonical form a graph's operations come before its weights


class Refused(Exception):
    """The runtime does not take this network, or it does not fit the header."""


def main(frames_in: int, frames_out: int) -> int:
    """Serve one model; see the module. Returns the exit status."""
    write_message(frames_out, {"state": "locked"})
    keep_freed_memory()
    fetch_memory(frames_in)
    _, [onnx] = read_message(frames_in, blob_limit=MAX_NETWORK)
    try:
        session = load(onnx)
        del onnx  # the session has its own copy
        header, _ = read_message(frames_in)
        policy = Policy(session, header)
    except Refused as refusal:
        write_message(frames_out, {"state": "refused", "detail": str(refusal), "version": onnxruntime.__version__})
        return 0
    except MemoryError:
        write_message(frames_out, {"state": "memory"})
        return EXIT_MEMORY
    write_message(frames_out, {"state": "ready", "version": onnxruntime.__version__})
    return serve(policy, frames_in, frames_out)


def keep_freed_memory() -> None:
    """Ask glibc to use freed memory again in place of new pages: on its way into a session a network is copied several
    times, and to clear new pages for every copy takes longer than the copies. Does nothing with another C library."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, (1 << 31) - 1)
        mallopt(_M_TOP_PAD, 32 << 20)


def fetch_memory(frames_in: int) -> None:
    """While nobody asks for anything, touch the memory that a large network will need, and give it back for that: a
    virtual machine gets it from its host page by page, which took up to half a second of an evaluation. Stops for the
    first byte of a request, between two blocks."""
    poller = select.poll()
    poller.register(frames_in, select.POLLIN)
    held, wait_ms = [], _IDLE_MS
    while len(held) < _BLOCKS and not poller.poll(wait_ms):
        held.append(b"\1" * _BLOCK)
        wait_ms = 0


def load(onnx: bytes) -> onnxruntime.InferenceSession:
    """A session of one thread that computes the same bits every time. Raises Refused, MemoryError."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.log_severity_level = 4
    # Bytes in onnxruntime's own format would be run too, by another parser than the one that judged the network.
    options.add_session_config_entry("session.load_model_format", "ONNX")
    if b"MatMul" not in onnx[:_OPERATIONS]:
        # Weights of dense layers lie as one row wants them (the gate sees to it, and makes convolutions of the large
        # ones): packed for many rows they would take twice the memory and longer to load. A bare MatMul has them the
        # other way.
        options.add_session_config_entry("session.disable_prepacking", "1")
    try:
        return onnxruntime.InferenceSession(onnx, options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise _memory_or(error, Refused(_plain(str(error)))) from None


def serve(policy: Policy, frames_in: int, frames_out: int) -> int:
    """Answer requests until the input closes."""
    request, reply = policy.request, policy.reply
    while _read_into(frames_in, request):
        reply[: STEP.size] = request[: STEP.size]
        try:
            policy.run()
        except MemoryError:
            return EXIT_MEMORY
        os.write(frames_out, reply)  # far below PIPE_BUF: one piece
    return 0


class Policy:
    """A session whose input and output buffers are allocated once.

    ``request``: fill it as the module says; :meth:`run`; ``reply`` then holds the output behind the step number.
    Raises Refused.
    """

    def __init__(self, session: onnxruntime.InferenceSession, header: dict[str, Any]) -> None:
        self._session = session
        self._binding = self._session.io_binding()
        self._feeds: list[tuple[np.ndarray, np.ndarray]] = []
        self.request, observations = request_buffer(header)
        self.reply, self._action = reply_buffer(header)
        self._bind_inputs(observations)
        self._bind_output()

    def run(self) -> None:
        """One inference. Raises MemoryError; any other failure is the runtime's own exception."""
        for feed, observation in self._feeds:
            np.copyto(feed, observation, casting="unsafe")
        try:
            self._session.run_with_iobinding(self._binding)
        except Exception as error:
            raise _memory_or(error, error) from None
        np.copyto(self._action, self._output, casting="unsafe")

    def _bind_inputs(self, observations: dict[str, np.ndarray]) -> None:
        inputs = {node.name: node for node in self._session.get_inputs()}
        if set(inputs) != set(observations):
            raise Refused(_plain(f"its inputs are {sorted(inputs)} where the sensors are {sorted(observations)}"))
        for name, observation in observations.items():
            node = inputs[name]
            feed = np.zeros(_static(node), _dtype(node))
            self._feeds.append((feed, _layout(observation, feed.shape)))
            self._binding.bind_input(node.name, "cpu", 0, feed.dtype.type, feed.shape, feed.ctypes.data)

    def _bind_output(self) -> None:
        (*others, node) = self._session.get_outputs()
        shape = _static(node)
        if others or math.prod(shape) != self._action.size:
            raise Refused(f"its output is not one row of {self._action.size} values")
        output = np.zeros(shape, _dtype(node))
        self._binding.bind_output(node.name, "cpu", 0, output.dtype.type, output.shape, output.ctypes.data)
        self._output = output.reshape(-1)


def _memory_or(error: Exception, otherwise: Exception) -> Exception:
    """onnxruntime reports memory that the limit refused as a message of one of its own exceptions."""
    text = f"{error}".lower()
    if isinstance(error, MemoryError) or any(
        word in text for word in ("bad_alloc", "bad allocation", "allocate memory")
    ):
        return MemoryError()
    return otherwise


def _plain(text: str) -> str:
    """One short printable line: node and tensor names in it are a stranger's text."""
    text = " ".join(text.split())[:200]
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _static(node: Any) -> tuple[int, ...]:
    if not all(isinstance(size, int) and size > 0 for size in node.shape):
        raise Refused(f"{_plain(node.name)} has no fixed shape")
    return tuple(node.shape)


def _dtype(node: Any) -> type:
    if node.type not in _DTYPES:
        raise Refused(f"{node.type} is not a type that it may have")
    return _DTYPES[node.type]


def _layout(observation: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A view of ``observation`` (H, W, C or a row) in the shape of the model's input."""
    if shape == (1, *observation.shape):
        return observation[np.newaxis]
    if observation.ndim == 3 and shape == (1, observation.shape[2], *observation.shape[:2]):
        return observation.transpose(2, 0, 1)[np.newaxis]
    raise Refused(f"an input of shape {list(shape)} does not take a sensor of shape {list(observation.shape)}")


def _read_into(fd: int, buffer: bytearray) -> bool:
    """Fill ``buffer``; False when the stream ended between two requests."""
    filled = os.readv(fd, (buffer,))  # nearly always all of it
    if filled == len(buffer):
        return True
    if filled == 0:
        return False
    view = memoryview(buffer)
    while filled < len(buffer):
        count = os.readv(fd, [view[filled:]])
        if count == 0:
            raise FrameClosed("the stream ended within a request")
        filled += count
    return True
