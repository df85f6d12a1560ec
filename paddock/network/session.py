"""A canonical network ready to run: the optimised runtime session and the float64 reference."""

from dataclasses import dataclass

import numpy as np
import onnxruntime

from paddock.errors import UserFault

from .bound import Input, NetworkFacts
from .canonical import CanonicalNetwork, write_model
from .dense import ALIGNED, Order, aligned_room, dense_as_convolutions, in_blocks
from .model import DTYPES
from .reference import Reference

_ALONE = 1 << 20  # bytes from which the runtime takes a weight as our array, without a copy


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
    """A session of one thread. ``onnx``: unchanged while the network is used. ``facts``: of the network's admission.
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
    """A session whose large dense layers are convolutions, in the runtime's order if it takes them so."""

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
    # the runtime must not read its own format, which the gate did not check
    options.add_session_config_entry("session.load_model_format", "ONNX")
    if not any(node.op == "MatMul" for node in network.nodes):
        # the canonical order of dense weights is the fastest for one row; packing takes twice the memory
        options.add_session_config_entry("session.disable_prepacking", "1")
    for name, array in network.weights.items():  # one at a time, to hold none twice for long
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
    """The array at an aligned address, where the runtime's kernels read it at full speed."""
    if array.flags.c_contiguous and array.ctypes.data % ALIGNED == 0:
        return array
    placed = aligned_room(array.shape, array.dtype)
    placed[...] = array
    return placed


def memory_or(error: Exception, otherwise: Exception) -> Exception:
    """MemoryError for an exception of onnxruntime that reports a lack of memory."""
    words = ("bad_alloc", "bad allocation", "allocate memory")
    lacks_memory = isinstance(error, MemoryError) or any(word in f"{error}".lower() for word in words)
    return MemoryError() if lacks_memory else otherwise


def plain(text: str) -> str:
    """One short printable line of text that a stranger may have written."""
    text = " ".join(text.split())[:200]
    return "".join(letter if letter.isprintable() else "?" for letter in text)
