"""A network as an ONNX file, written byte by byte, with each weight copied once, or not at all.

Protobuf's own way (tensors made, put into a graph, the graph into a model, the model serialised) holds every weight up
to five times, which for 57 million of them is more than a gigabyte; and its library takes a tenth of a second to import
where a car waits for its start. The bytes are those of ``SerializeToString(deterministic=True)``, to the last one.
Message layouts: onnx/onnx.proto; wire format: protobuf.dev, "Encoding".
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from .model import BOOL, FLOAT, FLOAT16, INT32, INT64, UINT8, Attribute, Node, Port, Rejected

NUMBERS = {"f4": FLOAT, "u1": UINT8, "i4": INT32, "i8": INT64, "b1": BOOL, "f2": FLOAT16}
NAME = "car"
_VARINT, _BYTES, _FIXED32 = 0, 2, 5
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
    graph: list[Part] = [_field(1, _node(node)) for node in nodes]
    graph.append(_text(2, NAME))
    for name, array in weights.items():
        graph += _initializer(name, array, name in outside)
    graph += [_field(11, _value_info(port)) for port in inputs]
    graph.append(_field(12, _value_info(output)))
    before = _number(1, ir_version)
    opset_import = _text(1, "") + _number(2, opset)
    head = _key(7, _BYTES) + _varint(sum(map(len, graph)))
    return b"".join([before, head, *graph, _field(8, opset_import)])


def _node(node: Node) -> bytes:
    said = b"".join(_text(1, name) for name in node.inputs)
    said += b"".join(_text(2, name) for name in node.outputs)
    said += _text(4, node.op)
    return said + b"".join(_field(5, _attribute(name, value)) for name, value in node.attributes.items())


def _attribute(name: str, value: Attribute) -> bytes:
    said = _text(1, name)
    if isinstance(value, bool | int | np.integer):
        return said + _number(3, int(value)) + _number(20, _ONE_INT)
    if isinstance(value, float | np.floating):
        return said + _float(2, value) + _number(20, _ONE_FLOAT)
    if isinstance(value, str | bytes):
        text = value.encode() if isinstance(value, str) else value
        return said + _field(4, text) + _number(20, _ONE_STRING)
    if isinstance(value, np.ndarray):
        tensor = b"".join(_number(1, size) for size in value.shape) + _number(2, NUMBERS[value.dtype.str[1:]])
        return said + _field(5, tensor + _field(9, value.tobytes())) + _number(20, _ONE_TENSOR)
    if isinstance(value, Rejected):
        raise ValueError(f"{name} is no attribute that can be written")
    # the type of an empty list cannot be guessed; only whole numbers may be empty here
    if value and isinstance(value[0], float):
        return said + b"".join(_float(7, item) for item in value) + _number(20, _FLOATS)
    return said + b"".join(_number(8, int(item)) for item in value) + _number(20, _INTS)


def _initializer(name: str, array: np.ndarray, outside: bool) -> list[Part]:
    said = b"".join(_number(1, size) for size in array.shape) + _number(2, NUMBERS[array.dtype.str[1:]])
    said += _text(8, name)
    if outside:
        place = _field(13, _text(1, "location") + _text(2, name))
        return [_field(5, said + place + _number(14, _EXTERNAL))]
    raw = np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
    said += _key(9, _BYTES) + _varint(len(raw))
    return [_key(5, _BYTES) + _varint(len(said) + len(raw)) + said, raw]


def _value_info(port: Port) -> bytes:
    shape = b"".join(_field(1, _number(1, size)) for size in port.sizes)
    tensor = _number(1, port.dtype) + _field(2, shape)
    return _text(1, port.name) + _field(2, _field(1, tensor))


def _field(number: int, content: bytes) -> bytes:
    return _key(number, _BYTES) + _varint(len(content)) + content


def _text(number: int, text: str) -> bytes:
    return _field(number, text.encode())


def _number(number: int, value: int) -> bytes:
    return _key(number, _VARINT) + _varint(value & (1 << 64) - 1)  # negative ones in two's complement


def _float(number: int, value: float) -> bytes:
    return _key(number, _FIXED32) + struct.pack("<f", value)


def _key(number: int, kind: int) -> bytes:
    return _varint(number << 3 | kind)


def _varint(value: int) -> bytes:
    written = bytearray()
    while value > 0x7F:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    written.append(value)
    return bytes(written)
