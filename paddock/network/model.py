"""Reads an ONNX file, within bounds, into the few elements that a policy network may contain."""

# Unlike a protobuf library it refuses a second graph, unknown fields and millions of objects. Message layouts:
# onnx/onnx.proto (IR version 13).

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from paddock.errors import UserFault

from . import wire
from .outside import FileBounds, OutsideWeights
from .wire import Budget, TooManyFields, WireError, printable

OPSET_LOW, OPSET_HIGH = 11, 21
IR_LOW, IR_HIGH = 3, 13
# TensorProto.DataType
FLOAT, UINT8, INT32, INT64, BOOL, FLOAT16 = 1, 2, 6, 7, 9, 10
DTYPES: dict[int, np.dtype] = {
    FLOAT: np.dtype("<f4"),
    UINT8: np.dtype("u1"),
    INT32: np.dtype("<i4"),
    INT64: np.dtype("<i8"),
    BOOL: np.dtype("?"),
    FLOAT16: np.dtype("<f2"),
}
_TYPE_NAMES = {
    0: "undefined", 3: "int8", 4: "uint16", 5: "int16", 8: "string", 11: "double", 12: "uint32", 13: "uint64",
    14: "complex64", 15: "complex128", 16: "bfloat16", 21: "uint4", 22: "int4", 23: "float4",
}  # fmt: skip
_MAX_NAME = 1000
MAX_RANK = 8


class Rejected:
    """An attribute of a forbidden kind: a graph, a reference, a sparse tensor."""


REJECTED = Rejected()
T = TypeVar("T")
Attribute = int | float | str | list[int] | list[float] | np.ndarray | Rejected


@dataclass
class Node:
    """One operation; an empty input name is an omitted input. ``name``: the exporter's, for messages. ``domain``: of
    an operator that is written for the runtime alone."""

    op: str
    inputs: list[str]
    outputs: list[str]
    attributes: dict[str, Attribute]
    name: str = ""
    domain: str = ""

    def whole(self, name: str, default: int | None = None) -> int:
        """A whole number. As the others, raises KeyError without value and default, TypeError for another type."""
        return self._single(name, int, default)

    def real(self, name: str, default: float) -> float:
        return self._single(name, float, default)

    def text(self, name: str, default: str) -> str:
        return self._single(name, str, default)

    def array(self, name: str, default: np.ndarray) -> np.ndarray:
        return self._single(name, np.ndarray, default)

    def wholes(self, name: str) -> list[int] | None:
        """A list of whole numbers, None without the attribute."""
        value = self.attributes.get(name)
        if value is not None and not isinstance(value, list):
            raise TypeError(name)
        return None if value is None else [int(item) for item in value]

    def _single(self, name: str, kind: type[T], default: T | None) -> T:
        value = self.attributes.get(name, default)
        if value is None:
            raise KeyError(name)
        if not isinstance(value, kind):
            raise TypeError(name)
        return value


@dataclass
class Port:
    """A graph input or output. ``dims`` holds None for a size that is not fixed."""

    name: str
    dtype: int
    dims: list[int | None]

    @property
    def sizes(self) -> tuple[int, ...]:
        """The dims of a port of fixed sizes. Raises ValueError."""
        fixed = tuple(size for size in self.dims if size is not None)
        if len(fixed) < len(self.dims):
            raise ValueError(f"{self.name} has a size that is not fixed")
        return fixed


@dataclass
class Model:
    opset: int = 0
    nodes: list[Node] = field(default_factory=list)
    weights: dict[str, np.ndarray] = field(default_factory=dict)
    inputs: list[Port] = field(default_factory=list)
    outputs: list[Port] = field(default_factory=list)


def read_model(data: bytes | memoryview, limits: FileBounds, weights: Mapping[str, bytes] | None = None) -> Model:
    """Parse a serialised ModelProto. ``weights``: the files beside it, by name. Raises UserFault."""
    reader = _Reader(limits, OutsideWeights(weights or {}, limits))
    try:
        return reader.model(memoryview(data))
    except TooManyFields as error:
        raise UserFault("onnx_too_big", part="fields", limit=limits.wire_fields) from error
    except WireError as error:
        raise UserFault("onnx_corrupt") from error


Field = int | memoryview


class _Reader:
    def __init__(self, limits: FileBounds, outside: OutsideWeights) -> None:
        self._limits = limits
        self._outside = outside
        self._budget = Budget(limits.wire_fields)

    def _fields(self, data: Field, once: set[int], many: set[int]) -> Iterator[tuple[int, int, Field]]:
        """The message's fields, all of which must be in ``once`` (at most one each) or ``many``."""
        seen = set()
        for number, kind, value in wire.fields(wire.message(data), self._budget):
            if number in once:
                if number in seen:
                    raise WireError("a field that must be single comes twice")
                seen.add(number)
            elif number not in many:
                raise WireError("an unknown field")
            yield number, kind, value

    def _name(self, value: Field) -> str:
        name = wire.text(value)
        if len(name) > _MAX_NAME:
            raise WireError("a name beyond all use")
        return name

    def _integers(self, kind: int, value: Field) -> list[int]:
        if kind == wire.VARINT:
            return [wire.signed(wire.number(value))]
        if kind != wire.BYTES:
            raise WireError("whole numbers were expected")
        return wire.packed_varints(wire.message(value), self._budget)

    @staticmethod
    def _floats(kind: int, value: Field) -> list[float]:
        raw = wire.message(value)
        if kind not in (wire.FIXED32, wire.BYTES) or len(raw) % 4:
            raise WireError("32-bit numbers were expected")
        return [float(number) for number in np.frombuffer(raw, "<f4")]

    def _cap(self, count: int, part: str, limit: int) -> None:
        if count > limit:
            raise UserFault("onnx_too_big", part=part, limit=limit)

    def model(self, data: memoryview) -> Model:
        model = Model()
        graph: Field | None = None
        opsets: dict[str, int] = {}
        version = 0
        for number, _, value in self._fields(data, {1, 2, 3, 4, 5, 6, 7}, {8, 14, 20, 25, 26}):
            if number == 1:
                version = wire.number(value)
            elif number == 7:
                graph = value
            elif number == 8:
                domain, opset = self._opset(value)
                if domain in opsets:
                    raise WireError("one operator set in two versions")
                opsets[domain] = opset
            elif number in (20, 25):
                raise UserFault("onnx_functions")
        if graph is None or not IR_LOW <= version <= IR_HIGH:
            raise WireError("no graph, or an unknown version of the format")
        opsets = {"" if domain == "ai.onnx" else domain: opset for domain, opset in opsets.items()}
        model.opset = opsets.pop("", 0)
        # torch names operator sets that it does not use; the nodes are checked one by one
        if not OPSET_LOW <= model.opset <= OPSET_HIGH:
            raise UserFault("onnx_opset", low=OPSET_LOW, high=OPSET_HIGH)
        self._graph(graph, model)
        return model

    def _opset(self, data: Field) -> tuple[str, int]:
        domain, version = "", 0
        for number, _, value in self._fields(data, {1, 2}, set()):
            if number == 1:
                domain = self._name(value)
            else:
                version = wire.signed(wire.number(value))
        return domain, version

    def _graph(self, data: Field, model: Model) -> None:
        for number, _, value in self._fields(data, {2, 10}, {1, 5, 11, 12, 13, 14, 15, 16}):
            if number == 1:
                self._cap(len(model.nodes) + 1, "operators", self._limits.nodes)
                model.nodes.append(self._node(value))
            elif number == 5:
                name, array = self._tensor(value)
                if not name or name in model.weights:
                    raise UserFault("onnx_graph", problem="two weights of one name")
                model.weights[name] = array
            elif number in (11, 12):
                ports = model.inputs if number == 11 else model.outputs
                ports.append(self._port(value))
                self._cap(len(ports), "inputs and outputs", self._limits.nodes)
            elif number == 15:
                raise UserFault("onnx_functions")

    def _node(self, data: Field) -> Node:
        node = Node("", [], [], {})
        domain = ""
        for number, _, value in self._fields(data, {3, 4, 6, 7, 8}, {1, 2, 5, 9, 10}):
            if number == 1:
                node.inputs.append(self._name(value))
            elif number == 2:
                node.outputs.append(self._name(value))
            elif number == 3:
                node.name = self._name(value)
            elif number == 4:
                node.op = self._name(value)
            elif number == 5:
                name, content = self._attribute(value)
                if name in node.attributes:
                    raise WireError("one attribute twice")
                node.attributes[name] = content
            elif number == 7:
                domain = self._name(value)
            elif number == 8 and wire.message(value):
                raise UserFault("onnx_functions")
        if domain not in ("", "ai.onnx"):
            raise UserFault("onnx_domain", domain=printable(domain, 40), operator=printable(node.op, 40))
        return node

    def _attribute(self, data: Field) -> tuple[str, Attribute]:
        name, kind, rejected = "", 0, False
        found: dict[int, list] = {}
        readers: dict[int, Callable[[int, Field], list]] = {
            2: self._floats,
            3: self._integers,
            4: lambda _, value: [self._name(value)],
            5: lambda _, value: [self._tensor(value)[1]],
            7: self._floats,
            8: self._integers,
        }
        forbidden = {6, 9, 10, 11, 14, 15, 21, 22, 23}
        for number, wire_kind, value in self._fields(data, {1, 2, 3, 4, 5, 13, 20}, {7, 8} | forbidden):
            if number == 1:
                name = self._name(value)
            elif number == 20:
                kind = wire.number(value)
            elif number in readers:
                found.setdefault(number, []).extend(readers[number](wire_kind, value))
            elif number in forbidden:
                rejected = True
        # AttributeProto.AttributeType: which field counts, and its value when the writer left out a zero
        places: dict[int, tuple[int, list]]
        places = {1: (2, [0.0]), 2: (3, [0]), 3: (4, [""]), 4: (5, []), 6: (7, []), 7: (8, [])}
        if rejected or kind not in places or not set(found) <= {places[kind][0]}:
            return name, REJECTED
        field_number, missing = places[kind]
        values = found.get(field_number, missing)
        if kind in (6, 7):
            return name, values
        if len(values) != 1:
            raise WireError("a single value was expected")
        return name, values[0]

    def _port(self, data: Field) -> Port:
        name, port = "", None
        for number, _, value in self._fields(data, {1, 2, 3}, {4}):
            if number == 1:
                name = self._name(value)
            elif number == 2:
                port = self._type(value)
        if port is None or not name:
            raise UserFault("onnx_graph", problem="an input or output without a type")
        return Port(name, *port)

    def _type(self, data: Field) -> tuple[int, list[int | None]]:
        for number, _, value in self._fields(data, {1, 4, 5, 6, 7, 8, 9}, set()):
            if number == 1:
                return self._tensor_type(value)
            if number != 6:
                raise UserFault("onnx_tensor_type", type="sequence, map or optional")
        raise UserFault("onnx_graph", problem="an input or output without a type")

    def _tensor_type(self, data: Field) -> tuple[int, list[int | None]]:
        dtype, dims = 0, None
        for number, _, value in self._fields(data, {1, 2}, set()):
            if number == 1:
                dtype = wire.number(value)
            else:
                dims = [self._dim(item) for _, _, item in self._fields(value, set(), {1})]
        self._dtype(dtype)
        if dims is None or len(dims) > MAX_RANK:
            raise UserFault("onnx_dynamic")
        return dtype, dims

    def _dim(self, data: Field) -> int | None:
        size = None
        for number, _, value in self._fields(data, {1, 2, 3}, set()):
            if number == 1:
                size = wire.signed(wire.number(value))
        return size if size is not None and size > 0 else None

    @staticmethod
    def _dtype(number: int) -> np.dtype:
        if number not in DTYPES:
            raise UserFault("onnx_tensor_type", type=_TYPE_NAMES.get(number, f"number {number}"))
        return DTYPES[number]

    def _tensor(self, data: Field) -> tuple[str, np.ndarray]:
        name, number_of_type, raw = "", 0, None
        dims: list[int] = []
        floats: list[memoryview] = []
        whole: list[int] = []
        is_outside = False
        place: dict[str, str] = {}
        for number, kind, value in self._fields(data, {2, 3, 8, 9, 12, 14}, {1, 4, 5, 6, 7, 10, 11, 13, 16}):
            if number == 1:
                dims.extend(self._integers(kind, value))
            elif number == 2:
                number_of_type = wire.number(value)
            elif number == 4:
                floats.append(wire.message(value))
            elif number in (5, 7):
                whole.extend(self._integers(kind, value))
            elif number == 8:
                name = self._name(value)
            elif number == 9:
                raw = wire.message(value)
            elif number == 13:
                key, value_text = self._entry(value)
                if key in place:
                    raise WireError("one entry twice")
                place[key] = value_text
            elif number == 14:
                is_outside = wire.number(value) != 0
            elif number in (3, 6, 10, 11):
                raise UserFault("onnx_tensor")
        dtype = self._dtype(number_of_type)
        if len(dims) > MAX_RANK or any(size < 0 for size in dims):
            raise UserFault("onnx_tensor")
        count = math.prod(dims)
        self._cap(count, "weights in one tensor", self._limits.tensor_elements)
        if is_outside or place:
            if not is_outside or raw is not None or floats or whole:
                raise UserFault("onnx_external_data", problem="both in the file and outside of it")
            return name, self._outside.read(place, dtype, dims)
        array = self._values(dtype, raw, floats, whole)
        if array.size != count:
            raise UserFault("onnx_tensor")
        return name, array.reshape(dims)

    def _entry(self, data: Field) -> tuple[str, str]:
        """A StringStringEntryProto."""
        texts = {1: "", 2: ""}
        for number, _, value in self._fields(data, {1, 2}, set()):
            texts[number] = self._name(value)
        return texts[1], texts[2]

    @staticmethod
    def _values(dtype: np.dtype, raw: memoryview | None, floats: list[memoryview], whole: list[int]) -> np.ndarray:
        """The values of a tensor from the one field that carries them."""
        if sum((raw is not None, bool(floats), bool(whole))) > 1:
            raise UserFault("onnx_tensor")
        if floats or raw is not None:
            content = b"".join(floats) if floats or raw is None else raw
            if (floats and dtype != DTYPES[FLOAT]) or len(content) % dtype.itemsize:
                raise UserFault("onnx_tensor")
            if dtype.kind == "b" and np.frombuffer(content, "u1").max(initial=0) > 1:
                raise UserFault("onnx_tensor")
            return np.frombuffer(content, dtype)
        if dtype == DTYPES[FLOAT] and whole:
            raise UserFault("onnx_tensor")
        if dtype == DTYPES[FLOAT16]:
            return np.array([number & 0xFFFF for number in whole], "<u2").view("<f2")
        low, high = (0, 1) if dtype.kind == "b" else (np.iinfo(dtype).min, np.iinfo(dtype).max) if whole else (0, 0)
        if not all(low <= number <= high for number in whole):
            raise UserFault("onnx_tensor")
        return np.array(whole, dtype)
