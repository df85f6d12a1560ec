"""Writes a network as an ONNX file, byte by byte, and copies each weight at most once."""

# Protobuf holds every weight up to five times and takes a tenth of a second to import. The bytes are those of
# ``SerializeToString(deterministic=True)``. Message layouts: onnx/onnx.proto; wire format: protobuf.dev, "Encoding".

import struct
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from .model import BOOL, FLOAT, FLOAT16, INT32, INT64, UINT8, Attribute, Node, Port, Rejected
from .wire import BYTES, FIXED32, VARINT

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
    """A ModelProto. A port with a size that is not fixed is written without its shape. ``outside``: weights that are
    only declared, for the runtime to take as arrays."""
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
    encoded = b"".join(text(1, name) for name in node.inputs)
    encoded += b"".join(text(2, name) for name in node.outputs)
    encoded += text(4, node.op)
    encoded += b"".join(message(5, _attribute(name, value)) for name, value in node.attributes.items())
    return encoded + text(7, node.domain) if node.domain else encoded


def _attribute(name: str, value: Attribute) -> bytes:
    encoded = text(1, name)
    if isinstance(value, bool | int | np.integer):
        return encoded + number(3, int(value)) + number(20, _ONE_INT)
    if isinstance(value, float | np.floating):
        return encoded + real(2, value) + number(20, _ONE_FLOAT)
    if isinstance(value, str | bytes):
        letters = value.encode() if isinstance(value, str) else value
        return encoded + message(4, letters) + number(20, _ONE_STRING)
    if isinstance(value, np.ndarray):
        tensor = b"".join(number(1, size) for size in value.shape) + number(2, NUMBERS[value.dtype.str[1:]])
        return encoded + message(5, tensor + message(9, value.tobytes())) + number(20, _ONE_TENSOR)
    if isinstance(value, Rejected):
        raise ValueError(f"{name} cannot be written")
    # an empty list is one of whole numbers
    if value and isinstance(value[0], float):
        return encoded + b"".join(real(7, item) for item in value) + number(20, _FLOATS)
    return encoded + b"".join(number(8, int(item)) for item in value) + number(20, _INTS)


def _initializer(name: str, array: np.ndarray, outside: bool) -> list[Part]:
    encoded = b"".join(number(1, size) for size in array.shape) + number(2, NUMBERS[array.dtype.str[1:]])
    encoded += text(8, name)
    if outside:
        place = message(13, text(1, "location") + text(2, name))
        return [message(5, encoded + place + number(14, _EXTERNAL))]
    raw = np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
    encoded += key(9, BYTES) + varint(len(raw))
    return [key(5, BYTES) + varint(len(encoded) + len(raw)) + encoded, raw]


def _value_info(port: Port) -> bytes:
    tensor = number(1, port.dtype)
    if None not in port.dims:
        tensor += message(2, b"".join(message(1, number(1, size)) for size in port.sizes))
    return text(1, port.name) + message(2, message(1, tensor))


def message(place: int, content: bytes) -> bytes:
    """A nested message, or bytes."""
    return key(place, BYTES) + varint(len(content)) + content


def text(place: int, value: str) -> bytes:
    return message(place, value.encode())


def number(place: int, value: int) -> bytes:
    """A whole number, negative ones in two's complement, or a truth value."""
    return key(place, VARINT) + varint(value & (1 << 64) - 1)


def real(place: int, value: float) -> bytes:
    return key(place, FIXED32) + struct.pack("<f", value)


def key(place: int, kind: int) -> bytes:
    """The key of a field: its number and the kind of its value."""
    return varint(place << 3 | kind)


def varint(value: int) -> bytes:
    """A whole number of at least 0, seven bits a byte."""
    written = bytearray()
    while value > 0x7F:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    written.append(value)
    return bytes(written)
