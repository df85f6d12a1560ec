"""Reads a frozen TensorFlow GraphDef without TensorFlow."""

# Message layouts: tensorflow/core/framework/{graph,node_def,attr_value,tensor,tensor_shape,types}.proto.

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from paddock.errors import UserFault
from paddock.network import wire
from paddock.network.wire import Budget, WireError
from paddock.packages.limits import PackageLimits

Default = TypeVar("Default")
# DataType values of types.proto that a policy network can hold, and the TensorProto field with their plain values.
DTYPES: dict[int, np.dtype] = {
    1: np.dtype("<f4"),
    2: np.dtype("<f8"),
    3: np.dtype("<i4"),
    4: np.dtype("u1"),
    9: np.dtype("<i8"),
    10: np.dtype("?"),
    19: np.dtype("<f2"),
}
_FLOAT_VAL, _DOUBLE_VAL, _INT_VAL, _INT64_VAL, _BOOL_VAL, _HALF_VAL = 5, 6, 7, 10, 11, 13
_MAX_RANK = 8


@dataclass
class Attributes:
    """A node's attributes, decoded on demand. Asking for the wrong kind raises :class:`WireError`."""

    raw: dict[str, memoryview]
    budget: Budget

    def _find(self, name: str, wanted: int, default: Default) -> int | memoryview | Default:
        found = _last(self.raw[name], wanted, self.budget) if name in self.raw else None
        return default if found is None else found

    def integer(self, name: str, default: int = 0) -> int:
        return wire.signed(wire.number(self._find(name, 3, default)))

    def flag(self, name: str, default: bool = False) -> bool:
        return bool(wire.number(self._find(name, 5, int(default))))

    def real(self, name: str, default: float = 0.0) -> float:
        value = self._find(name, 4, None)
        return default if value is None else float(np.frombuffer(wire.message(value), "<f4")[0])

    def text(self, name: str, default: str = "") -> str:
        value = self._find(name, 2, None)
        return default if value is None else wire.text(value)

    def dtype(self, name: str) -> np.dtype | None:
        """The type, or None if it is missing or of no use in a policy network."""
        return DTYPES.get(wire.number(self._find(name, 6, 0)))

    def function(self, name: str) -> str:
        """The name of the function that an attribute refers to."""
        value = self._find(name, 10, None)
        if value is None:
            raise WireError("a call without a function")
        function = _last(wire.message(value), 1, self.budget)
        return "" if function is None else wire.text(function)

    def integers(self, name: str, default: list[int] | None = None) -> list[int]:
        value = self._find(name, 1, None)
        if value is None:
            return list(default or [])
        result: list[int] = []
        for number, kind, item in wire.fields(wire.message(value), self.budget):
            if number == 3 and kind == wire.VARINT:
                result.append(wire.signed(wire.number(item)))
            elif number == 3:
                result.extend(wire.packed_varints(wire.message(item), self.budget))
        return result

    def shape(self, name: str) -> list[int] | None:
        """Dimensions, -1 for an unknown one; None if the rank is unknown."""
        value = self._find(name, 7, None)
        return None if value is None else _shape(wire.message(value), self.budget)

    def tensor(self, name: str, limits: PackageLimits) -> np.ndarray:
        value = self._find(name, 8, None)
        if value is None:
            raise WireError("a constant without a value")
        return _tensor(wire.message(value), self.budget, limits)


@dataclass
class TensorflowNode:
    """One operation. ``inputs`` are ``(node, output index)``; ``controls`` are nodes that only have to run before."""

    name: str
    op: str
    inputs: list[tuple[str, int]]
    controls: list[str]
    attributes: Attributes


@dataclass
class Function:
    """A function of the graph's library: what TensorFlow 2 writes the branches of ``tf.cond`` as. ``results``: where
    its outputs come from, in their order; a name of ``arguments`` stands for that argument."""

    arguments: list[str]
    nodes: dict[str, TensorflowNode]
    results: list[tuple[str, int]]


@dataclass
class Graph:
    """All nodes by name, in the file's order. The functions of its library are read when they are called."""

    nodes: dict[str, TensorflowNode] = field(default_factory=dict)
    library: dict[str, memoryview] = field(default_factory=dict)
    budget: Budget = field(default_factory=lambda: Budget(0))

    def function(self, name: str) -> Function:
        """Raises :class:`WireError` where the library has no function of this name."""
        if name not in self.library:
            raise WireError("a function that is not there")
        return _function(self.library[name], self.budget)

    @cached_property
    def sinks(self) -> list[TensorflowNode]:
        """Nodes without readers, except loose constants."""
        used = {name for node in self.nodes.values() for name, _ in node.inputs}
        return [node for node in self.nodes.values() if node.name not in used and node.op not in ("Const", "NoOp")]


def read_graph(data: bytes, limits: PackageLimits) -> Graph:
    """Parse a serialised GraphDef.

    Raises UserFault ``graph_unreadable`` or ``graph_too_big``. Constants stay in the bytes until they are asked for.
    """
    budget = Budget(limits.wire_fields)
    graph = Graph(budget=budget)
    try:
        for number, _, value in wire.fields(memoryview(data), budget):
            if number == 1:
                if len(graph.nodes) >= limits.graph_nodes:
                    raise UserFault("graph_too_big", limit=limits.graph_nodes)
                node = _node(wire.message(value), budget)
                if node.name in graph.nodes:
                    raise WireError("two nodes of one name")
                graph.nodes[node.name] = node
            elif number == 2:
                _add_library(graph, wire.message(value))
            elif number not in (3, 4, 5):  # version, versions, debug_info
                raise WireError("not a GraphDef")
    except wire.TooManyFields as error:
        raise UserFault("graph_too_big", limit=limits.wire_fields) from error
    except WireError as error:
        raise UserFault("graph_unreadable") from error
    if not graph.nodes:
        raise UserFault("graph_unreadable")
    return graph


# The outputs of an operation that has several, by the names that function bodies call them by. An operation that is
# not here has one, which may be a list (``output:1`` is its second value).
_BATCH_NORM = ("y", "batch_mean", "batch_variance", "reserve_space_1", "reserve_space_2", "reserve_space_3")
_OUTPUTS: dict[str, tuple[str, ...]] = {
    **{op: _BATCH_NORM for op in ("FusedBatchNorm", "FusedBatchNormV2", "FusedBatchNormV3")},
    "Switch": ("output_false", "output_true"),
    "Merge": ("output", "value_index"),
}


def _last(data: memoryview, wanted: int, budget: Budget) -> int | memoryview | None:
    """The last value of a field in a message, which is the one that counts; None without one."""
    found = None
    for number, _, value in wire.fields(data, budget):
        if number == wanted:
            found = value
    return found


def _add_library(graph: Graph, data: memoryview) -> None:
    for number, _, value in wire.fields(data, graph.budget):
        if number != 1:  # gradients, which a car does not need
            continue
        definition = wire.message(value)
        signature = _last(definition, 1, graph.budget)
        name = None if signature is None else _last(wire.message(signature), 1, graph.budget)
        if name is not None:
            graph.library[wire.text(name)] = definition


def _function(data: memoryview, budget: Budget) -> Function:
    """A FunctionDef. Its nodes name their inputs ``argument`` or ``node:output:index``."""
    arguments: list[str] = []
    outputs: list[str] = []
    nodes: dict[str, TensorflowNode] = {}
    returned: dict[str, str] = {}
    for number, _, value in wire.fields(data, budget):
        if number == 1:
            for part, _, item in wire.fields(wire.message(value), budget):
                if part in (2, 3):
                    (arguments if part == 2 else outputs).append(_map_entry(wire.message(item), budget)[0])
        elif number == 3:
            node = _node(wire.message(value), budget)
            nodes[node.name] = node
        elif number == 4:
            key, content = _map_entry(wire.message(value), budget)
            returned[key] = wire.text(content)
    ops = {name: node.op for name, node in nodes.items()}
    for node in nodes.values():
        node.inputs = [_inner(name, index, ops) for name, index in node.inputs]
    if not all(name in returned for name in outputs):
        raise WireError("a function without its result")
    results = [_inner(*_reference(returned[name]), ops) for name in outputs]
    return Function(arguments, nodes, results)


def _inner(name: str, index: int, ops: dict[str, str]) -> tuple[str, int]:
    """A reference in a function's body as those of a graph."""
    source, colon, output = name.rpartition(":")
    if not colon:
        return name, index
    names = _OUTPUTS.get(ops.get(source, ""), ())
    if not names:
        return source, index
    if output not in names:
        raise WireError("an output that is not there")
    return source, names.index(output)


def _node(data: memoryview, budget: Budget) -> TensorflowNode:
    name, op = "", ""
    inputs: list[tuple[str, int]] = []
    controls: list[str] = []
    attributes: dict[str, memoryview] = {}
    for number, _, value in wire.fields(data, budget):
        if number == 1:
            name = wire.text(value)
        elif number == 2:
            op = wire.text(value)
        elif number == 3:
            reference = wire.text(value)
            if reference.startswith("^"):
                controls.append(reference[1:])
            else:
                inputs.append(_reference(reference))
        elif number == 5:
            key, content = _map_entry(wire.message(value), budget)
            attributes[key] = content
    if not name or not op or len(name) > 1000:
        raise WireError("a node without a name or operation")
    return TensorflowNode(name, op, inputs, controls, Attributes(attributes, budget))


def _reference(text: str) -> tuple[str, int]:
    name, colon, index = text.rpartition(":")
    if not colon:
        return text, 0
    if not index.isdigit() or len(index) > 4:
        raise WireError("a malformed input name")
    return name, int(index)


def _map_entry(data: memoryview, budget: Budget) -> tuple[str, memoryview]:
    key, content = "", data[:0]
    for number, _, value in wire.fields(data, budget):
        if number == 1:
            key = wire.text(value)
        elif number == 2:
            content = wire.message(value)
    return key, content


def _shape(data: memoryview, budget: Budget) -> list[int] | None:
    dims: list[int] = []
    for number, _, value in wire.fields(data, budget):
        if number == 3 and wire.number(value):
            return None
        if number == 2:
            size = _last(wire.message(value), 1, budget)
            dims.append(0 if size is None else wire.signed(wire.number(size)))
            if len(dims) > _MAX_RANK:
                raise WireError("too many dimensions")
    return dims


def _tensor(data: memoryview, budget: Budget, limits: PackageLimits) -> np.ndarray:
    """A TensorProto as an array. Its size is checked before anything is allocated."""
    dtype: np.dtype | None = None
    shape: list[int] | None = []
    content: memoryview | None = None
    values: list[tuple[int, int, int | memoryview]] = []
    for number, kind, value in wire.fields(data, budget):
        if number == 1:
            dtype = DTYPES.get(wire.number(value))
        elif number == 2:
            shape = _shape(wire.message(value), budget)
        elif number == 4:
            content = wire.message(value)
        elif number in (_FLOAT_VAL, _DOUBLE_VAL, _INT_VAL, _INT64_VAL, _BOOL_VAL, _HALF_VAL):
            values.append((number, kind, value))
    if dtype is None or shape is None or any(size < 0 for size in shape):
        raise WireError("a constant of unknown type or shape")
    count = math.prod(shape)
    if count > limits.tensor_elements:
        raise WireError("a constant beyond every limit")
    if content:
        if len(content) != count * dtype.itemsize:
            raise WireError("a constant whose bytes do not fit its shape")
        return np.frombuffer(content, dtype).reshape(shape)
    return _filled(_plain_values(values, dtype, budget), count, dtype).reshape(shape)


def _plain_values(values: list[tuple[int, int, int | memoryview]], dtype: np.dtype, budget: Budget) -> np.ndarray:
    """The repeated ``*_val`` fields, packed or not."""
    parts: list[np.ndarray] = [np.zeros(0, dtype)]
    for number, kind, value in values:
        if number in (_FLOAT_VAL, _DOUBLE_VAL):
            width = 4 if number == _FLOAT_VAL else 8
            raw = wire.message(value)
            if len(raw) % width:
                raise WireError("a cut off list of numbers")
            parts.append(np.frombuffer(raw, f"<f{width}").astype(dtype))
            continue
        numbers = (
            [wire.signed(wire.number(value))]
            if kind == wire.VARINT
            else wire.packed_varints(wire.message(value), budget)
        )
        if number == _HALF_VAL:
            parts.append(np.array([n & 0xFFFF for n in numbers], "<u2").view("<f2").astype(dtype))
        else:
            info = np.iinfo(dtype) if dtype.kind in "iu" else None
            if info and not all(info.min <= n <= info.max for n in numbers):
                raise WireError("a number beyond its type")
            parts.append(np.array(numbers, "<i8").astype(dtype))
    return np.concatenate(parts)


def _filled(values: np.ndarray, count: int, dtype: np.dtype) -> np.ndarray:
    """TensorFlow stores equal trailing values once: repeat the last one (zero if there is none)."""
    if len(values) > count:
        raise WireError("more values than the shape holds")
    if len(values) == count:
        return values
    result = np.empty(count, dtype)
    result[: len(values)] = values
    result[len(values) :] = values[-1] if len(values) else dtype.type(0)
    return result
