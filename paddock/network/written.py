"""A network as an ONNX file, written byte by byte, with each weight copied once, or not at all.

Protobuf's own way (tensors made, put into a graph, the graph into a model, the model serialised) holds every weight up
to five times, which for 57 million of them is more than a gigabyte; and its library takes a tenth of a second to import
where a car waits for its start. The bytes are those of ``SerializeToString(deterministic=True)``, to the last one.
Message layouts: onnx/onnx.proto; wire format: protobuf.dev, "Encoding".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from .fields import BYTES, key, message, number, real, text, varint
from .model import BOOL, FLOAT, FLOAT16, INT32, INT64, UINT8, Attribute, Node, Port, Rejected

NUMBERS = {"f4": FLOAT, "u1": UINT8, "i4": INT32, "i8": INT64, "b1": BOOL, "f2": FLOAT16}
NAME = "car"
_EXTERNAL = 1  # TensorProto.DataLocation
_ONE_FLOAT, _ONE_INT, _ONE_STRING, _ONE_TENSOR, _FLOATS, _INTS = 1, 2, 3, 4, 6, 7  # AttributeProto.AttributeType

Part = bytes | memoryview


def model_bytes(
    nodes: Sequence[Node],
    inputs: Sequence[Port],
    output: Port,
    weights: Mapping[str, np.ndarray],
    opset: int,
    ir_version: int,
    outside: AbstractSet[str] = frozenset(),
) -> bytes:
    """A ModelProto. All sizes of ``inputs`` and ``output`` are fixed. ``outside``: weights that are only declared, and
    handed to the runtime as arrays."""
    graph: list[Part] = [message(1, _node(node)) for node in nodes]
    graph.append(text(2, NAME))
    for name, array in weights.items():
        graph += _initializer(name, array, name in outside)
    graph += [message(11, _value_info(port)) for port in inputs]
    graph.append(message(12, _value_info(output)))
    before = number(1, ir_version)
    opsets = [text(1, "") + number(2, opset)]
    opsets += [text(1, domain) + number(2, 1) for domain in sorted({node.domain for node in nodes if node.domain})]
    head = key(7, BYTES) + varint(sum(map(len, graph)))
    return b"".join([before, head, *graph, *(message(8, one) for one in opsets)])


def _node(node: Node) -> bytes:
    said = b"".join(text(1, name) for name in node.inputs)
    said += b"".join(text(2, name) for name in node.outputs)
    said += text(4, node.op)
    said += b"".join(message(5, _attribute(name, value)) for name, value in node.attributes.items())
    return said + text(7, node.domain) if node.domain else said


def _attribute(name: str, value: Attribute) -> bytes:
    said = text(1, name)
    if isinstance(value, bool | int | np.integer):
        return said + number(3, int(value)) + number(20, _ONE_INT)
    if isinstance(value, float | np.floating):
        return said + real(2, value) + number(20, _ONE_FLOAT)
    if isinstance(value, str | bytes):
        letters = value.encode() if isinstance(value, str) else value
        return said + message(4, letters) + number(20, _ONE_STRING)
    if isinstance(value, np.ndarray):
        tensor = b"".join(number(1, size) for size in value.shape) + number(2, NUMBERS[value.dtype.str[1:]])
        return said + message(5, tensor + message(9, value.tobytes())) + number(20, _ONE_TENSOR)
    if isinstance(value, Rejected):
        raise ValueError(f"{name} is no attribute that can be written")
    # the type of an empty list cannot be guessed; only whole numbers may be empty here
    if value and isinstance(value[0], float):
        return said + b"".join(real(7, item) for item in value) + number(20, _FLOATS)
    return said + b"".join(number(8, int(item)) for item in value) + number(20, _INTS)


def _initializer(name: str, array: np.ndarray, outside: bool) -> list[Part]:
    said = b"".join(number(1, size) for size in array.shape) + number(2, NUMBERS[array.dtype.str[1:]])
    said += text(8, name)
    if outside:
        place = message(13, text(1, "location") + text(2, name))
        return [message(5, said + place + number(14, _EXTERNAL))]
    raw = np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
    said += key(9, BYTES) + varint(len(raw))
    return [key(5, BYTES) + varint(len(said) + len(raw)) + said, raw]


def _value_info(port: Port) -> bytes:
    shape = b"".join(message(1, number(1, size)) for size in port.sizes)
    tensor = number(1, port.dtype) + message(2, shape)
    return text(1, port.name) + message(2, message(1, tensor))
