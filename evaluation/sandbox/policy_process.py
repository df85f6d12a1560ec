"""A model in the sandbox: ``main`` runs in its own locked process, made by :class:`.policy.PolicyProcess`.

It says ``{"state": "locked"}``, hears of the canonical ONNX bytes (where they are, or the bytes themselves) and then of
the header (two messages, so that the network loads while the referee still starts), answers ``{"state": "ready"}`` or
why not, and then answers the fixed-size requests of :mod:`paddock.network.policy_wire` until its input closes. How it
answers one is in :mod:`paddock.simulator.deciding`. ``sys.argv[1:]``: the descriptors of the memory in which it is
shown what its car sees (:mod:`.shown`) and of that in which its network will lie (:mod:`.given`), -1 for none.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import sys

import numpy as np
import onnxruntime

from paddock.network.blocked import arranger
from paddock.network.bound import NetworkFacts
from paddock.network.canonical import CanonicalNetwork, write_model
from paddock.network.model import FLOAT, Node, Port
from paddock.network.policy_wire import REPLY, STEP
from paddock.network.session import Refused, load
from paddock.simulator.deciding import Policy

from .frames import MAX_NETWORK, FrameClosed, read_message, write_message
from .given import taken
from .lock import EXIT_MEMORY
from .shown import fits, to_read

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_MAX = -1, -2, -4  # malloc.h
_IDLE_MS = 100  # without a request for so long, there is time to prepare for one
_BLOCK, _BLOCKS = 4 << 20, 32  # bytes; in all what the largest network takes on its way into a session


def main(frames_in: int, frames_out: int) -> int:
    """Serve one model; see the module. Returns the exit status."""
    shown_fd, given_fd = map(int, sys.argv[1:]) if len(sys.argv) > 1 else (-1, -1)
    memory = to_read(shown_fd)
    write_message(frames_out, {"state": "locked"})
    keep_freed_memory()
    get_ready(frames_in)
    given, blobs = read_message(frames_in, blob_limit=MAX_NETWORK)
    try:
        onnx = taken(given_fd, given["size"]) if "size" in given else blobs[0]
        facts = given.get("facts")
        network = load(onnx, None if facts is None else NetworkFacts.from_dict(facts))
        header, _ = read_message(frames_in)
        policy = Policy(network, header, memory if fits(header) else None)
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


def get_ready(frames_in: int) -> None:
    """While nobody asks for anything: meet once what every network meets, and get the memory that a large one needs."""
    poller = select.poll()
    poller.register(frames_in, select.POLLIN)
    if not poller.poll(_IDLE_MS):
        with contextlib.suppress(Exception):  # nothing hangs on it
            rehearse()
        fetch_memory(frames_in)


def fetch_memory(frames_in: int) -> None:
    """Touch the memory that a large network will need, and give it back for that: a virtual machine gets it from its
    host page by page, which took up to half a second of an evaluation. Stops for the first byte of a request, between
    two blocks."""
    poller = select.poll()
    poller.register(frames_in, select.POLLIN)
    held: list[bytes] = []
    while len(held) < _BLOCKS and not poller.poll(0):
        held.append(b"\1" * _BLOCK)


def rehearse() -> None:
    """Load a small network of ours and ask it, both ways: the first session of a process takes three times as long as
    the next one, some five milliseconds more."""
    weights: dict[str, np.ndarray] = {
        "kernels": np.zeros((4, 1, 5, 5), np.float32),
        "kernels_bias": np.zeros(4, np.float32),
        "dense": np.ones((2, 4 * 13 * 18), np.float32),
        "dense_bias": np.arange(2, dtype=np.float32),
    }
    nodes = [
        Node("AveragePool", ["camera"], ["pooled"], {"kernel_shape": [4, 4], "strides": [4, 4]}),
        Node("Conv", ["pooled", "kernels", "kernels_bias"], ["seen"], {"kernel_shape": [5, 5], "strides": [2, 2]}),
        Node("Relu", ["seen"], ["on"], {}),
        Node("Flatten", ["on"], ["flat"], {"axis": 1}),
        Node("Gemm", ["flat", "dense", "dense_bias"], ["actions"], {"transB": 1}),
    ]
    camera, actions = Port("camera", FLOAT, [1, 1, 120, 160]), Port("actions", FLOAT, [1, 2])
    network = write_model(CanonicalNetwork(17, [camera], actions, nodes, weights))
    header = {"inputs": [{"name": "camera", "dtype": "uint8", "shape": [120, 160, 1]}], "outputs": 2, "ranges": None}
    for bound in (2.0**-20, None):
        Policy(load(network, NetworkFacts(bound=bound)), header).run()
    arranger()


def serve(policy: Policy, frames_in: int, frames_out: int) -> int:
    """Answer requests until the input closes."""
    request, reply = policy.request, policy.reply
    while _read_into(frames_in, request):
        try:
            way = policy.run()
            REPLY.pack_into(reply, 0, *STEP.unpack_from(request), way)
        except MemoryError:
            return EXIT_MEMORY
        os.write(frames_out, reply)  # far below PIPE_BUF: one piece
    return 0


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
