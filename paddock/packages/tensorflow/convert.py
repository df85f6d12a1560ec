"""From a frozen TensorFlow graph to ONNX, for a batch of one.

The graph is evaluated from the policy backwards with known and unknown values: everything that does not depend on the
sensors (shapes, frozen training flags, weights) is computed here, the rest becomes ONNX nodes. What the policy does not
need is never looked at, and branches that are not taken (those of training) are dead, as in TensorFlow's executor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paddock.errors import UserFault
from paddock.network.wire import TooManyFields, WireError, printable
from paddock.packages.inputs import InputSpec
from paddock.packages.limits import DEFAULT_LIMITS, PackageLimits

from . import ops_control, ops_math, ops_nn, ops_shape  # noqa: F401  (they register their converters)
from .emit import Emitter
from .graph import Graph, TensorflowNode, read_graph
from .heads import find_policy
from .ops_math import unary
from .ops_shape import cast
from .ours import read_ours
from .registry import CONVERTERS, Context, Contradiction, Unsupported, require
from .values import DEAD, Dead, Flow, Known, Tensor, Value

_FLOAT = np.dtype("<f4")
_SOURCES = ("Const", "Placeholder")


def convert(graph_def: bytes, inputs: Sequence[InputSpec], limits: PackageLimits = DEFAULT_LIMITS) -> bytes:
    """Convert a serialised GraphDef to a serialised ONNX model (opset 17; of one that Paddock wrote, the very network
    that it was written from).

    Its inputs are named as the sensors: pictures uint8 ``[1, height, width, channels]``, others float32
    ``[1, values]``. Raises UserFault with a code of the conversion section.
    """
    graph = read_graph(graph_def, limits)
    if (ours := read_ours(graph_def, graph, inputs, limits)) is not None:
        return ours
    policy, squashed = find_policy(graph)
    conversion = _Conversion(graph, inputs, limits)
    output = conversion.evaluate(policy)
    if squashed and isinstance(output, Tensor) and output.dtype == _FLOAT:
        output = unary(conversion.context, "Tanh", np.tanh, output)
    if not isinstance(output, Tensor) or output.dtype != _FLOAT:
        raise UserFault("graph_output")
    conversion.check_inputs()
    return conversion.context.emit.model(output)


class _Conversion:
    def __init__(self, graph: Graph, inputs: Sequence[InputSpec], limits: PackageLimits) -> None:
        self._graph = graph
        self._specs = {spec.sensor: spec for spec in inputs}
        self._read: dict[str, Tensor] = {}  # by sensor
        self._strangers: list[str] = []
        self._done: dict[str, Sequence[Flow]] = {}
        self.context = Context(Emitter(limits), limits)

    def evaluate(self, policy: TensorflowNode) -> Flow:
        """The first output of ``policy``. Works off a stack of its own: a graph may be deeper than Python's."""
        stack = [policy.name]
        underway: set[str] = set()
        while stack:
            name = stack[-1]
            if name in self._done:
                stack.pop()
                continue
            node = self._node(name)
            missing = [source for source in self._sources(node) if source not in self._done]
            if missing:
                if name in underway:
                    raise UserFault("graph_invalid", node=printable(name))  # a cycle
                underway.add(name)
                stack.extend(missing)
                continue
            self._done[name] = self._convert(node)
            underway.discard(name)
            stack.pop()
        return self._done[policy.name][0]

    def _node(self, name: str) -> TensorflowNode:
        node = self._graph.nodes.get(name)
        if node is None:
            raise UserFault("graph_invalid", node=printable(name))
        return node

    def _sources(self, node: TensorflowNode) -> list[str]:
        """The nodes to evaluate before this one."""
        if node.op in _SOURCES:
            return self._gates(node)
        return [name for name, _ in node.inputs] + self._gates(node)

    def _gates(self, node: TensorflowNode) -> list[str]:
        """Control inputs that can be dead: a branch's constants hang on the branch by the identity of its switch."""
        gates = []
        for name in node.controls:
            gate = self._graph.nodes.get(name)
            if gate is not None and gate.op == "Identity" and gate.inputs:
                source = self._graph.nodes.get(gate.inputs[0][0])
                if source is not None and source.op == "Switch":
                    gates.append(name)
        return gates

    def _convert(self, node: TensorflowNode) -> Sequence[Flow]:
        try:
            if any(self._done[gate][0] is DEAD for gate in self._gates(node)):
                return [DEAD]
            if node.op in _SOURCES:
                require(not node.inputs)
            if node.op == "Placeholder":
                return [self._placeholder(node)]
            values = [self._output(name, index) for name, index in node.inputs]
            alive = [value for value in values if not isinstance(value, Dead)]
            if node.op == "Merge":
                require(len(alive) <= 1)
                return [alive[0], Known(np.array(values.index(alive[0]), np.int32))] if alive else [DEAD, DEAD]
            if len(alive) < len(values):
                return [DEAD]
            converter = CONVERTERS.get(node.op)
            if converter is None:
                raise Unsupported
            return converter(self.context, node, alive)
        except Unsupported as error:
            raise UserFault(
                "graph_operation", operation=printable(node.op, 40), node=printable(node.name)
            ) from error  # fmt: skip
        except TooManyFields as error:
            raise UserFault("graph_too_big", limit=self.context.limits.wire_fields) from error
        except (Contradiction, WireError) as error:
            raise UserFault("graph_invalid", node=printable(node.name)) from error

    def _output(self, name: str, index: int) -> Flow:
        outputs = self._done[name]
        if outputs[0] is DEAD and index >= len(outputs):
            return DEAD
        require(index < len(outputs))
        return outputs[index]

    def _placeholder(self, node: TensorflowNode) -> Value:
        """A sensor's input, or the flag that says whether the network is being trained (it is not)."""
        sensor = node.name.rsplit("/", 1)[-1]
        dtype = node.attributes.dtype("dtype")
        if dtype is not None and dtype.kind == "b":
            return Known(np.array(False))
        spec = self._specs.get(sensor)
        if spec is None:
            self._strangers.append(sensor)
            raise self._wrong_inputs()
        stored = node.attributes.shape("shape") or [-1] * len(spec.channels_last)
        fits = len(stored) == len(spec.channels_last) and all(
            size in (-1, wanted) for size, wanted in zip(stored, spec.channels_last, strict=True)
        )
        if not fits:
            raise UserFault(
                "onnx_input_shape", sensor=sensor, found=str(stored[:8]), expected=str(list(spec.channels_last))
            )  # fmt: skip
        if dtype not in (_FLOAT, np.dtype("u1")):
            raise Contradiction
        if sensor not in self._read:
            stored_dtype = np.dtype("u1") if spec.is_picture else _FLOAT
            self._read[sensor] = self.context.emit.input(sensor, spec.channels_last, stored_dtype)
        source = self._read[sensor]
        return source if source.dtype == dtype else cast(self.context, source, dtype)

    def check_inputs(self) -> None:
        """Every sensor of the metadata must be read."""
        if set(self._read) != set(self._specs):
            raise self._wrong_inputs()

    def _wrong_inputs(self) -> UserFault:
        found = ", ".join(sorted({*self._read, *self._strangers})) or "nothing"
        return UserFault("graph_inputs", found=printable(found), expected=", ".join(sorted(self._specs)))
