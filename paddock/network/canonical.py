"""Writes a network in its one canonical form, without names, order, comments and padding of the file."""

# Constants become weights, operations without effect and unneeded parts are dropped, nodes are ordered by dependency,
# and values are numbered in that order. The weights of a dense layer are stored output by output, in which order the
# runtime computes one row fastest. The runtime never reads a byte of the uploaded file.

from __future__ import annotations

from collections import Counter
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from paddock.errors import UserFault

from .model import FLOAT, Model, Node, Port, read_model
from .wire import printable
from .written import model_bytes

OUTPUT_NAME = "actions"
IR_VERSION = 10
_BAND = 128  # rows


class _Admitted(NamedTuple):
    """The bounds of an admitted file: practically none."""

    wire_fields: int = 1 << 30
    nodes: int = 1 << 30
    tensor_elements: int = 1 << 40
    model_bytes: int = 1 << 40


@dataclass
class CanonicalNetwork:
    """The pruned, ordered and renamed graph. Inputs keep their names."""

    opset: int
    inputs: list[Port]
    output: Port
    nodes: list[Node] = field(default_factory=list)
    weights: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def read(cls, onnx: bytes | memoryview) -> CanonicalNetwork:
        """The network that :func:`write_model` wrote; its weights are views into the bytes. Raises UserFault."""
        model = read_model(onnx, _Admitted())
        if len(model.outputs) != 1 or any(None in port.dims for port in (*model.inputs, *model.outputs)):
            raise UserFault("onnx_dynamic")
        return cls(model.opset, model.inputs, model.outputs[0], model.nodes, model.weights)

    @property
    def parameters(self) -> int:
        """The number of trained weights, without single constants and shapes."""
        return sum(array.size for array in self.weights.values() if array.ndim and array.dtype.kind == "f")


def canonicalise(model: Model, target: Port | None = None) -> CanonicalNetwork:
    """Bring the part of a model that ``target`` (default: its only output) needs into the one form. Raises UserFault
    ``onnx_graph``."""
    inputs = [port for port in model.inputs if port.name not in model.weights]
    plain = _Plain(model, inputs)
    if target is None:
        (target,) = model.outputs
    network = _Numbering(model.opset, inputs, plain).network(target)
    _transpose_dense(network)
    return network


def _transpose_dense(network: CanonicalNetwork) -> None:
    """Store the weights of every Gemm transposed (``transB`` = 1), where nothing else reads them."""
    uses = Counter(name for node in network.nodes for name in node.inputs)
    for node in network.nodes:
        if node.op != "Gemm" or len(node.inputs) < 2 or node.attributes.get("transB", 0) != 0:
            continue
        weight = network.weights.get(node.inputs[1])
        if weight is not None and weight.ndim == 2 and uses[node.inputs[1]] == 1:
            network.weights[node.inputs[1]] = _transposed(weight)
            node.attributes = dict(sorted({**node.attributes, "transB": 1}.items()))


def _transposed(weight: np.ndarray) -> np.ndarray:
    """A transposed copy, written in bands that fit into the processor's cache: five times faster for large weights."""
    copy = np.empty(weight.shape[::-1], weight.dtype)
    for begin in range(0, len(weight), _BAND):
        copy[:, begin : begin + _BAND] = weight[begin : begin + _BAND].T
    return copy


class _Plain:
    """The graph without constants and idle operations: the maker of each value, the weights, and aliases."""

    def __init__(self, model: Model, inputs: list[Port]) -> None:
        self.weights = dict(model.weights)
        self.makers: dict[str, Node] = {}
        self._same: dict[str, str] = {}
        self._known = {port.name for port in inputs}
        if len(self._known) != len(inputs):
            raise UserFault("onnx_graph", problem="two inputs of one name")
        defined = self._known | set(self.weights)
        for node in model.nodes:
            if any(name and name not in defined for name in node.inputs):
                raise UserFault("onnx_graph", problem=f"a {node.op} reads a value that nobody made before it")
            if not node.outputs:
                raise UserFault("onnx_graph", problem=f"a {node.op} without a result")
            for name in filter(None, node.outputs):
                if name in defined:
                    raise UserFault("onnx_graph", problem="two values of one name")
                defined.add(name)
            self._add(node)

    def _add(self, node: Node) -> None:
        if node.op == "Constant":
            self.weights[node.outputs[0]] = _constant(node)
        elif node.op == "Identity":
            self._alias(node)
        elif node.op == "Dropout":
            if len(node.inputs) > 2 and node.inputs[2]:
                mode = self.weights.get(self.original(node.inputs[2]))
                if mode is None or mode.any():
                    raise UserFault(
                        "onnx_attribute",
                        operator="Dropout",
                        attribute="training_mode",
                        where=printable(node.name, 80) or "-",
                    )
            self._alias(node)
        else:
            for name in filter(None, node.outputs):
                self.makers[name] = node

    def _alias(self, node: Node) -> None:
        if len(node.inputs) < 1 or not node.inputs[0] or any(node.outputs[1:]):
            raise UserFault("onnx_graph", problem=f"a {node.op} with too few or too many values")
        self._same[node.outputs[0]] = self.original(node.inputs[0])

    def original(self, name: str) -> str:
        return self._same.get(name, name)

    def exists(self, name: str) -> bool:
        return name in self.makers or name in self.weights or name in self._known


class _Numbering:
    """Walks from the output back to the inputs and numbers the values."""

    def __init__(self, opset: int, inputs: list[Port], plain: _Plain) -> None:
        self._plain = plain
        self._network = CanonicalNetwork(opset, inputs, Port(OUTPUT_NAME, FLOAT, []))
        self._names = {port.name: port.name for port in inputs}
        self._placed: set[int] = set()
        self._values = 0

    def network(self, target: Port) -> CanonicalNetwork:
        source = self._plain.original(target.name)
        if not self._plain.exists(source):
            raise UserFault("onnx_graph", problem="the output is made by no operator")
        if source in self._plain.makers:
            self._place(self._plain.makers[source])
        last = Node("Identity", [self._rename(source)], [OUTPUT_NAME], {})
        self._network.nodes.append(last)
        self._network.output = Port(OUTPUT_NAME, target.dtype, target.dims)
        self._drop_last_identity(source)
        return self._network

    def _drop_last_identity(self, source: str) -> None:
        """Give the output's name to the operation that makes it, unless others read the value too."""
        if source not in self._plain.makers:
            return
        name = self._names[source]
        *nodes, _ = self._network.nodes
        if sum(node.inputs.count(name) for node in nodes) == 0:
            maker = next(node for node in nodes if name in node.outputs)
            maker.outputs[maker.outputs.index(name)] = OUTPUT_NAME
            self._network.nodes = nodes

    def _place(self, last: Node) -> None:
        """Append ``last`` after everything that it needs, in the order of its inputs."""
        stack = [last]
        while stack:
            node = stack[-1]
            if id(node) in self._placed:
                stack.pop()
                continue
            needs = [self._plain.makers.get(self._plain.original(name)) for name in node.inputs if name]
            waiting = [need for need in needs if need is not None and id(need) not in self._placed]
            if waiting:
                stack.append(waiting[0])
                continue
            inputs = [self._rename(self._plain.original(name)) if name else "" for name in node.inputs]
            outputs = [self._rename(name) if name else "" for name in node.outputs]
            attributes = dict(sorted(node.attributes.items()))
            self._network.nodes.append(Node(node.op, inputs, outputs, attributes, node.name, node.domain))
            self._placed.add(id(node))
            stack.pop()

    def _rename(self, name: str) -> str:
        if name not in self._names:
            weight = self._plain.weights.get(name)
            if weight is not None:
                self._names[name] = f"_w{len(self._network.weights)}"
                self._network.weights[self._names[name]] = weight
            else:
                self._values += 1
                self._names[name] = f"_v{self._values}"
        return self._names[name]


def _constant(node: Node) -> np.ndarray:
    if len(node.attributes) != 1 or len(node.outputs) != 1:
        raise UserFault("onnx_graph", problem="a Constant without exactly one value")
    ((name, value),) = node.attributes.items()
    if isinstance(value, np.ndarray):
        return value
    dtype = "<f4" if name in ("value_float", "value_floats") else "<i8"
    return np.array(value, dtype)


def write_model(network: CanonicalNetwork, outside: AbstractSet[str] = frozenset()) -> bytes:
    """The network as an ONNX file. ``outside``: as in :func:`.written.model_bytes`."""
    return model_bytes(
        network.nodes, network.inputs, network.output, network.weights, network.opset, IR_VERSION, outside
    )
