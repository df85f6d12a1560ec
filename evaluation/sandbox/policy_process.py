"""A model in the sandbox: ``main`` runs in its own locked process, started by :class:`.policy.PolicyProcess`.

It sends ``{"state": "locked"}``, receives the canonical ONNX bytes (or their place) and then the header, answers
``{"state": "ready"}`` or why not, and then answers the fixed-size requests of :mod:`paddock.network.policy_wire`
(:mod:`paddock.simulator.deciding`) until its input closes. ``sys.argv[1:]``: the descriptors of the
:mod:`.observation_memory` and of the :mod:`.network_memory`, -1 for none.
"""

import contextlib
import os
import select
import sys
from typing import cast

import numpy as np
import onnxruntime

from paddock.malloc import set_malloc_options
from paddock.network.bound import NetworkFacts
from paddock.network.canonical import CanonicalNetwork, write_model
from paddock.network.dense import arranger
from paddock.network.model import FLOAT, Node, Port
from paddock.network.policy_wire import REPLY, STEP, PolicyHeader
from paddock.network.session import Refused, load
from paddock.simulator.deciding import Policy

from .frames import LOCKED, MAX_NETWORK, FrameClosed, read_message, write_message
from .lock import EXIT_MEMORY
from .network_memory import map_network
from .observation_memory import fits, map_for_reading

_IDLE_MS = 100  # without a request for so long, there is time to prepare for one
_BLOCK, _BLOCKS = 4 << 20, 32  # bytes; in all what the largest network takes on its way into a session


def main(frames_in: int, frames_out: int) -> int:
    """Serve one model. Returns the exit status."""
    observations_fd, network_fd = map(int, sys.argv[1:]) if len(sys.argv) > 1 else (-1, -1)
    memory = map_for_reading(observations_fd)
    write_message(frames_out, LOCKED)
    keep_freed_memory()
    get_ready(frames_in)
    given, blobs = read_message(frames_in, blob_limit=MAX_NETWORK)
    try:
        onnx = map_network(network_fd, given["size"]) if "size" in given else blobs[0]
        facts = given.get("facts")
        network = load(onnx, None if facts is None else NetworkFacts.from_dict(facts))
        header = cast(PolicyHeader, read_message(frames_in)[0])
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
    """Have glibc reuse freed memory: a network is copied several times on its way into a session, and clearing new
    pages for every copy takes longer than the copies. Does nothing with another C library."""
    set_malloc_options(mmap_max=0, trim_threshold=(1 << 31) - 1, top_pad=32 << 20)


def get_ready(frames_in: int) -> None:
    """While no request comes: load a network once, and get the memory that a large one needs."""
    poller = select.poll()
    poller.register(frames_in, select.POLLIN)
    if not poller.poll(_IDLE_MS):
        with contextlib.suppress(Exception):  # nothing hangs on it
            rehearse()
        fetch_memory(frames_in)


def fetch_memory(frames_in: int) -> None:
    """Touch the memory that a large network will need and free it again: a virtual machine gets it from its host page
    by page, which took up to half a second. Stops at the first byte of a request, between two blocks."""
    poller = select.poll()
    poller.register(frames_in, select.POLLIN)
    held: list[bytes] = []
    while len(held) < _BLOCKS and not poller.poll(0):
        held.append(b"\1" * _BLOCK)


def rehearse() -> None:
    """Load a small network and run it both ways: the first session of a process takes five milliseconds more."""
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
    header: PolicyHeader
    header = {"inputs": [{"name": "camera", "dtype": "uint8", "shape": [120, 160, 1]}], "outputs": 2, "ranges": None}
    for bound in (2.0**-20, None):
        Policy(load(network, NetworkFacts(bound=bound)), header).run()
    arranger()


def serve(policy: Policy, frames_in: int, frames_out: int) -> int:
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
