"""From a frozen TensorFlow graph to ONNX, for a batch of one.

The graph is evaluated from the policy backwards with known and unknown values: everything that does not depend on the
sensors (shapes, frozen training flags, weights) is computed here, the rest becomes ONNX nodes. What the policy does not
need is never looked at, and branches that are not taken (those of training) are dead, as in TensorFlow's executor.
TensorFlow 2 writes such branches as functions: the branch taken is converted in place of its call.
"""

from __future__ import annotations

import math
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
from .registry import CONVERTERS, Context, Contradiction, Unsupported, known, require
from .values import DEAD, Dead, Flow, Known, Tensor, Value

_FLOAT = np.dtype("<f4")
_SOURCES = ("Const", "Placeholder")
_BRANCHES, _CALLS = ("If", "StatelessIf"), ("PartitionedCall", "StatefulPartitionedCall")
_SAME_CAMERA = {"observation": "FRONT_FACING_CAMERA", "FRONT_FACING_CAMERA": "observation"}  # the oldest files' name
_MOST_CALLS = 16  # of functions within functions


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
    output = conversion.evaluate(policy.name)
    if squashed and isinstance(output, Tensor) and output.dtype == _FLOAT:
        output = unary(conversion.context, "Tanh", np.tanh, output)
    if not isinstance(output, Tensor) or output.dtype != _FLOAT:
        raise UserFault("graph_output")
    conversion.check_inputs()
    return conversion.context.emit.model(output)


class _Conversion:
    def __init__(
        self, graph: Graph, inputs: Sequence[InputSpec], limits: PackageLimits, caller: _Conversion | None = None
    ) -> None:
        self._graph = graph
        self._depth: int = 0 if caller is None else caller._depth + 1
        self._specs = {spec.sensor: spec for spec in inputs}
        self._read: dict[str, Tensor] = {}  # by sensor
        self._strangers: list[str] = []
        self._done: dict[str, Sequence[Flow]] = {}
        self._called: dict[str, tuple[_Conversion, list[tuple[str, int]]]] = {}
        self.context: Context = Context(Emitter(limits), limits) if caller is None else caller.context

    def evaluate(self, wanted: str, index: int = 0) -> Flow:
        """One output of a node. Works with an explicit stack: a graph may be deeper than Python's."""
        stack = [wanted]
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
        return self._output(wanted, index)

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
        self.context.count_node()
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
            if node.op in (*_BRANCHES, *_CALLS):
                self._call(node, alive)
                return []
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
        except (Contradiction, WireError, ArithmeticError, TypeError, ValueError) as error:  # the latter are NumPy's
            raise UserFault("graph_invalid", node=printable(node.name)) from error

    def _call(self, node: TensorflowNode, values: list[Value]) -> None:
        """Enter a function, or the branch that is taken. Its results are converted when something reads them: those
        that TensorFlow adds for gradients are never read here."""
        name = "f"
        if node.op in _BRANCHES:
            require(bool(values) and math.prod(values[0].shape) == 1)
            name = "then_branch" if known(values[0]).reshape(-1)[0] else "else_branch"
            values = values[1:]
        if self._depth >= _MOST_CALLS:
            raise Unsupported
        function = self._graph.function(node.attributes.function(name))
        require(len(function.arguments) == len(values))
        body = Graph(function.nodes, self._graph.library, self._graph.budget)
        inner = _Conversion(body, (), self.context.limits, caller=self)
        inner._done.update((argument, [value]) for argument, value in zip(function.arguments, values, strict=True))
        self._called[node.name] = (inner, function.results)

    def _output(self, name: str, index: int) -> Flow:
        if name in self._called:
            body, results = self._called[name]
            require(index < len(results))
            return body.evaluate(*results[index])
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
        spec = self._specs.get(sensor) or self._specs.get(_SAME_CAMERA.get(sensor, ""))
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
        sensor = spec.sensor
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
