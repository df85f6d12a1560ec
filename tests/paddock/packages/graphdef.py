"""Writes frozen TensorFlow GraphDefs for tests, without TensorFlow.

The bytes are what TensorFlow's own serialiser would write (tensorflow/core/framework/*.proto).
"""

from __future__ import annotations

import math
import struct

import numpy as np

FLOAT, INT32, BOOL = 1, 3, 10
_NUMBERS = {"float32": 1, "float64": 2, "int32": 3, "uint8": 4, "int64": 9, "bool": 10}


def varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def field(number: int, value: int | bytes | str) -> bytes:
    """A varint field, or a length-delimited one."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, str):
        value = value.encode()
    return varint(number << 3 | 2) + varint(len(value)) + value


def shape_proto(shape: tuple[int, ...]) -> bytes:
    return b"".join(field(2, field(1, size)) for size in shape)


def tensor_proto(array: np.ndarray) -> bytes:
    """Scalars in the plain value fields and arrays as bytes, as TensorFlow does it."""
    number = _NUMBERS[array.dtype.name]
    head = field(1, number) + field(2, shape_proto(array.shape))
    if array.size == 1 and array.dtype == np.float32:
        return head + field(5, struct.pack("<f", array.item()))
    if array.size == 1 and array.dtype == np.int32:
        return head + field(7, varint(array.item()))
    if array.size == 1 and array.dtype == np.bool_:
        return head + field(11, varint(int(array.item())))
    return head + field(4, array.tobytes())


class Attr:
    """Makers of AttrValue messages."""

    @staticmethod
    def dtype(number: int) -> bytes:
        return field(6, number)

    @staticmethod
    def text(value: str) -> bytes:
        return field(2, value)

    @staticmethod
    def integer(value: int) -> bytes:
        return field(3, value)

    @staticmethod
    def flag(value: bool) -> bytes:
        return field(5, int(value))

    @staticmethod
    def real(value: float) -> bytes:
        return varint(4 << 3 | 5) + struct.pack("<f", value)

    @staticmethod
    def integers(values: list[int]) -> bytes:
        return field(1, field(3, b"".join(varint(value) for value in values)))

    @staticmethod
    def shape(shape: tuple[int, ...]) -> bytes:
        return field(7, shape_proto(shape))

    @staticmethod
    def tensor(array: np.ndarray) -> bytes:
        return field(8, tensor_proto(array))


class GraphWriter:
    """Collects nodes; every method returns the node's name, to be used as an input."""

    def __init__(self, seed: int = 0) -> None:
        self._nodes: list[bytes] = []
        self._random = np.random.default_rng(seed)

    def node(self, name: str, op: str, inputs: tuple[str, ...] | list[str] = (), **attributes: bytes) -> str:
        body = field(1, name) + field(2, op) + b"".join(field(3, source) for source in inputs)
        body += b"".join(field(5, field(1, key) + field(2, value)) for key, value in attributes.items())
        self._nodes.append(field(1, body))
        return name

    def const(self, name: str, value: object, dtype: str = "float32", controls: tuple[str, ...] = ()) -> str:
        array = np.asarray(value, dtype)
        number = Attr.dtype(_NUMBERS[array.dtype.name])
        return self.node(name, "Const", [f"^{c}" for c in controls], dtype=number, value=Attr.tensor(array))

    def variable(self, name: str, value: np.ndarray) -> str:
        """A frozen variable: a constant and the identity that reads it."""
        self.const(name, value)
        return self.node(f"{name}/read", "Identity", [name], T=Attr.dtype(FLOAT))

    def weights(self, name: str, shape: tuple[int, ...]) -> str:
        """Random weights that keep the size of what flows through them."""
        scale = math.sqrt(2.0 / max(1, math.prod(shape[:-1]))) if len(shape) > 1 else 0.1
        return self.variable(name, (self._random.standard_normal(shape) * scale).astype(np.float32))

    def positive(self, name: str, count: int) -> str:
        return self.variable(name, self._random.uniform(0.5, 2.0, count).astype(np.float32))

    def op(self, name: str, op: str, *inputs: str, **attributes: bytes) -> str:
        """A node on floats."""
        return self.node(name, op, inputs, T=Attr.dtype(FLOAT), **attributes)

    def build(self) -> bytes:
        return b"".join(self._nodes) + field(4, field(1, 38))
