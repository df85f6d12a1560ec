"""A canonical network, ready to answer: the runtime's session, optimised for our processors, and the reference.

Only here are networks changed for speed, so that tuning never changes who a car is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import onnxruntime

from paddock.errors import UserFault

from .blocked import ALIGNED, aligned_room, in_blocks
from .bound import NetworkFacts
from .canonical import CanonicalNetwork, write_model
from .dense import Order, dense_as_convolutions
from .model import DTYPES
from .probes import Input
from .reference import Reference

_ALONE = 1 << 20  # bytes of a weight that the runtime takes as our array, without a copy of its own


class Refused(Exception):
    """The runtime does not take this network, or it does not fit the header."""


@dataclass(frozen=True)
class Loaded:
    """``arrays``: weights that the session reads where they are."""

    session: onnxruntime.InferenceSession
    reference: Reference
    inputs: tuple[Input, ...]
    facts: NetworkFacts | None
    arrays: tuple[np.ndarray, ...]


def load(onnx: bytes | memoryview, facts: NetworkFacts | None = None) -> Loaded:
    """A session of one thread. ``onnx``: stays as it is as long as the network is used. ``facts``: from the network's
    admission, if they are known.

    Raises Refused, MemoryError."""
    try:
        network = CanonicalNetwork.read(onnx)
        reference = Reference(network)
        if facts is not None and facts.shapes:
            session, arrays = _with_convolutions(onnx, facts)
        else:
            session, arrays = _session(network)
    except UserFault as fault:
        raise Refused(plain(str(fault))) from None
    except KeyError as error:
        raise Refused(plain(f"{error} is no operator of a car's network, or a value without a shape")) from None
    inputs = tuple((port.name, DTYPES[port.dtype].name, port.sizes) for port in network.inputs)
    return Loaded(session, reference, inputs, facts, arrays)


def _with_convolutions(
    onnx: bytes | memoryview, facts: NetworkFacts
) -> tuple[onnxruntime.InferenceSession, tuple[np.ndarray, ...]]:
    """A session whose large dense layers are convolutions: in the runtime's own order where it takes them so."""

    def session(order: Order | None) -> tuple[onnxruntime.InferenceSession, tuple[np.ndarray, ...]]:
        return _session(dense_as_convolutions(CanonicalNetwork.read(onnx), dict(facts.shapes), order))

    try:
        return session(in_blocks)
    except Refused:
        return session(None)


def _session(network: CanonicalNetwork) -> tuple[onnxruntime.InferenceSession, tuple[np.ndarray, ...]]:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.log_severity_level = 4
    # Bytes in onnxruntime's own format would be run too, by another parser than the one that judged the network.
    options.add_session_config_entry("session.load_model_format", "ONNX")
    if not any(node.op == "MatMul" for node in network.nodes):
        # Weights of dense layers lie as one row wants them (the canonical form sees to it, and large ones are
        # convolutions): packed for many rows they would take twice the memory and longer to load. A bare MatMul has
        # them the other way.
        options.add_session_config_entry("session.disable_prepacking", "1")
    for name, array in network.weights.items():  # one at a time, so that none is held twice for long
        if array.nbytes >= _ALONE:
            network.weights[name] = _aligned(array)
        del array
    large = {name: array for name, array in network.weights.items() if array.nbytes >= _ALONE}
    try:
        written = write_model(network, outside=large.keys())
        if large:
            values = [onnxruntime.OrtValue.ortvalue_from_numpy(array) for array in large.values()]
            options.add_external_initializers(list(large), values)
        session = onnxruntime.InferenceSession(written, options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise memory_or(error, Refused(plain(str(error)))) from None
    return session, tuple(large.values())


def _aligned(array: np.ndarray) -> np.ndarray:
    """The array where the runtime's kernels read it at full speed: in a file, weights lie anywhere."""
    if array.flags.c_contiguous and array.ctypes.data % ALIGNED == 0:
        return array
    placed = aligned_room(array.shape, array.dtype)
    placed[...] = array
    return placed


def memory_or(error: Exception, otherwise: Exception) -> Exception:
    """onnxruntime reports memory that the limit refused as a message of one of its own exceptions."""
    text = f"{error}".lower()
    if isinstance(error, MemoryError) or any(
        word in text for word in ("bad_alloc", "bad allocation", "allocate memory")
    ):
        return MemoryError()
    return otherwise


def plain(text: str) -> str:
    """One short printable line: node and tensor names in it are a stranger's text."""
    text = " ".join(text.split())[:200]
    return "".join(letter if letter.isprintable() else "?" for letter in text)
