"""A network of few plain operations with fixed sizes, from which every export format is written."""

# ONNX has a hundred operators, and other formats define half of them differently. There are about forty plain
# operations: each exists in TensorFlow and in OpenVINO with the same meaning, and :mod:`.lower` expresses every other
# operator with them. Pictures are ``[1, channels, height, width]`` throughout.

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from paddock.errors import UserFault

FLOAT = np.dtype("<f4")
BOOL = np.dtype("?")
MOST = 64_000_000  # numbers in one value
UNARY = {
    *("abs", "neg", "sqrt", "exp", "log", "erf", "floor", "ceil", "round", "sign"),
    *("sigmoid", "tanh", "relu", "softplus", "not"),
}
BINARY = {"add", "sub", "mul", "div", "pow", "min", "max", "and", "or"}
COMPARING = {"equal", "less", "greater", "less_equal", "greater_equal"}
REDUCING = {"mean", "sum", "most", "least"}


@dataclass(frozen=True)
class Step:
    """What was done to a weight before it is written: its axes ordered anew, or reshaped; can be undone to the bit."""

    kind: str  # "transpose" or "reshape"
    numbers: tuple[int, ...]  # the order of the axes, or the new shape


@dataclass(frozen=True, eq=False)
class Const:
    """Numbers that hang on no sensor. ``origin``: the weight they are, after ``steps``; empty for what was computed."""

    array: np.ndarray
    origin: str = ""
    steps: tuple[Step, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        return self.array.shape

    @property
    def dtype(self) -> np.dtype:
        return self.array.dtype

    def transposed(self, order: Sequence[int]) -> "Const":
        step = Step("transpose", tuple(int(axis) for axis in order))
        return Const(self.array.transpose(step.numbers), self.origin, (*self.steps, step))

    def reshaped(self, shape: Sequence[int]) -> "Const":
        step = Step("reshape", tuple(int(size) for size in shape))
        return Const(self.array.reshape(step.numbers), self.origin, (*self.steps, step))


@dataclass(frozen=True, eq=False)
class Value:
    """A tensor that depends on the sensors."""

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype = FLOAT


Operand = Const | Value


@dataclass(frozen=True, eq=False)
class PlainOperation:
    """One plain operation: a word of this module's sets, or one of the methods of :class:`Plain`."""

    kind: str
    inputs: tuple[Operand, ...]
    output: Value
    attributes: dict[str, Any] = field(default_factory=dict)


class Plain:
    """Collects operations; every method returns the value that it makes."""

    def __init__(self) -> None:
        self.inputs: dict[str, Value] = {}  # by sensor
        self.operations: list[PlainOperation] = []
        self._made = 0
        self.output: Value | None = None

    def input(self, sensor: str, shape: tuple[int, ...]) -> Value:
        """A sensor's reading as float32; pictures 0 to 255, channels first."""
        self.inputs[sensor] = Value(sensor, shape)
        return self.inputs[sensor]

    def made_by(self, value: Operand) -> PlainOperation | None:
        """The operation that makes a value; None for a sensor's reading and for numbers."""
        return next((one for one in self.operations if one.output is value), None)

    def prune(self) -> None:
        needed = {id(self.output)}
        kept = []
        for operation in reversed(self.operations):
            if id(operation.output) in needed:
                needed.update(map(id, operation.inputs))
                kept.append(operation)
        self.operations = kept[::-1]

    def _add(
        self, kind: str, inputs: Sequence[Operand], shape: Sequence[int], dtype: np.dtype = FLOAT, **attributes: Any
    ) -> Value:
        sizes = tuple(int(size) for size in shape)
        if math.prod(sizes) > MOST:
            raise UserFault("network_too_wide")
        self._made += 1
        output = Value(f"v{self._made}", sizes, dtype)
        self.operations.append(PlainOperation(kind, tuple(inputs), output, attributes))
        return output

    def unary(self, kind: str, x: Operand) -> Value:
        assert kind in UNARY
        return self._add(kind, [x], x.shape, x.dtype)

    def binary(self, kind: str, left: Operand, right: Operand) -> Value:
        """Element by element, broadcasting as numpy does: a word of :data:`BINARY` or :data:`COMPARING`."""
        assert kind in BINARY or kind in COMPARING
        shape = np.broadcast_shapes(left.shape, right.shape)
        return self._add(kind, [left, right], shape, BOOL if kind in COMPARING else left.dtype)

    def where(self, condition: Operand, one: Operand, other: Operand) -> Value:
        shape = np.broadcast_shapes(condition.shape, one.shape, other.shape)
        return self._add("where", [condition, one, other], shape, one.dtype)

    def cast(self, x: Operand, dtype: np.dtype) -> Value:
        return self._add("cast", [x], x.shape, dtype)

    def reshape(self, x: Value, shape: Sequence[int]) -> Value:
        return x if tuple(shape) == x.shape else self._add("reshape", [x], shape, x.dtype)

    def transpose(self, x: Value, order: Sequence[int]) -> Value:
        wanted = tuple(int(axis) for axis in order)
        if wanted == tuple(range(len(wanted))):
            return x
        return self._add("transpose", [x], [x.shape[axis] for axis in wanted], x.dtype, order=wanted)

    def concat(self, parts: Sequence[Operand], axis: int) -> Value:
        shape = list(parts[0].shape)
        shape[axis] = sum(part.shape[axis] for part in parts)
        return self._add("concat", parts, shape, parts[0].dtype, axis=axis)

    def take(self, x: Value, axis: int, places: np.ndarray) -> Value:
        """Along one axis, the lines at these places (whole numbers of at least 0, one row of them)."""
        lines = np.asarray(places, np.int32).reshape(-1)
        if np.array_equal(lines, np.arange(x.shape[axis])):
            return x
        if not ((lines >= 0) & (lines < x.shape[axis])).all():
            raise IndexError
        shape = (*x.shape[:axis], lines.size, *x.shape[axis + 1 :])
        return self._add("take", [x, Const(lines)], shape, x.dtype, axis=axis)

    def pad(self, x: Value, before: Sequence[int], after: Sequence[int], number: float = 0.0) -> Value:
        if not any(before) and not any(after):
            return x
        shape = [low + size + high for low, size, high in zip(before, x.shape, after, strict=True)]
        return self._add("pad", [x], shape, x.dtype, before=tuple(before), after=tuple(after), number=float(number))

    def broadcast(self, x: Operand, shape: Sequence[int]) -> Operand:
        return x if tuple(shape) == x.shape else self._add("broadcast", [x], shape, x.dtype)

    def conv(self, x: Operand, kernel: Const, strides: Sequence[int], dilations: Sequence[int], groups: int) -> Value:
        """A convolution in two dimensions; ``kernel``: ``[filters, channels of a group, rows, columns]``."""
        space = [
            (size - dilation * (reach - 1) - 1) // stride + 1
            for size, reach, stride, dilation in zip(x.shape[2:], kernel.shape[2:], strides, dilations, strict=True)
        ]
        shape = (x.shape[0], kernel.shape[0], *space)
        turns = tuple(strides), tuple(dilations)
        return self._add("conv", [x, kernel], shape, strides=turns[0], dilations=turns[1], groups=groups)

    def pool(self, kind: str, x: Value, kernel: Sequence[int], strides: Sequence[int]) -> Value:
        """The greatest (``max_pool``) or the mean (``mean_pool``) under a window, in two dimensions."""
        space = [(size - k) // s + 1 for size, k, s in zip(x.shape[2:], kernel, strides, strict=True)]
        return self._add(kind, [x], (*x.shape[:2], *space), kernel=tuple(kernel), strides=tuple(strides))

    def matmul(self, left: Operand, right: Operand) -> Value:
        """The product of matrices, of at least two axes each; those before broadcast."""
        before = np.broadcast_shapes(left.shape[:-2], right.shape[:-2])
        return self._add("matmul", [left, right], (*before, left.shape[-2], right.shape[-1]))

    def reduce(self, kind: str, x: Operand, axes: Sequence[int], keep: bool) -> Value:
        """A word of :data:`REDUCING`, over axes."""
        assert kind in REDUCING
        gone = {axis % len(x.shape) for axis in axes}
        shape = [1 if at in gone else size for at, size in enumerate(x.shape) if keep or at not in gone]
        return self._add(kind, [x], shape, x.dtype, axes=tuple(sorted(gone)), keep=keep)

    def softmax(self, x: Value) -> Value:
        return self._add("softmax", [x], x.shape)
