"""Converts a frozen TensorFlow graph to ONNX, for a batch of one."""

# The graph is evaluated from the policy backwards with known and unknown values: everything that does not depend on the
# sensors (shapes, frozen training flags, weights) is computed here, the rest becomes ONNX nodes. Parts that the policy
# does not need are ignored, and branches that are not taken (those of training) are dead, as in TensorFlow's executor.
# TensorFlow 2 writes such branches as functions: the branch taken is converted in place of its call.
#
# RL-Coach ends the graph in ``<network>/ppo_head_0/policy`` (softmax over the actions, or the mean of a normal
# distribution) or in ``<network>/sac_policy_head_0/policy`` (the mean before squashing); its older heads call the mean
# ``policy_mean``. Source: deepracer-simapp, markov/boto/s3/constants.py (FROZEN_HEAD_OUTPUT_GRAPH_FORMAT_MAPPING) and
# markov/multi_agent_coach/architectures/tensorflow_components/heads/sac_head.py: the SAC car drives
# ``scale * tanh(mean) + bias``, which is tanh followed by the linear scaling to low and high.

import math
from collections.abc import Sequence

import numpy as np

from paddock.errors import UserFault
from paddock.network.wire import TooManyFields, WireError, printable
from paddock.packages.inputs import InputSpec
from paddock.packages.limits import DEFAULT_LIMITS, PackageLimits

from . import ops_math, ops_nn, ops_shape  # noqa: F401  (they register their converters)
from .emit import DEAD, FLOAT, Dead, Emitter, Flow, Known, Tensor, Value
from .graph import Graph, TensorflowNode, read_graph
from .ops_math import unary
from .ops_shape import cast
from .ours import read_ours
from .registry import CONVERTERS, Context, Contradiction, Unsupported, converts, known, require

_SOURCES = ("Const", "Placeholder")
_BRANCHES, _CALLS = ("If", "StatelessIf"), ("PartitionedCall", "StatefulPartitionedCall")
_SAME_CAMERA = {"observation": "FRONT_FACING_CAMERA", "FRONT_FACING_CAMERA": "observation"}  # the oldest files' name
_MOST_CALLS = 16  # of functions within functions
_PPO, _SAC = "ppo_head_0/policy", "sac_policy_head_0/policy"
_HEADS = ((_SAC, True), (_PPO, False), (f"{_SAC}_mean", True), (f"{_PPO}_mean", False))
_PASS_ON = ("Identity", "StopGradient", "ClipByValue", "Minimum", "Maximum")
NOT_FROZEN = ("Variable", "VariableV2", "VarHandleOp", "Assign", "AssignVariableOp")


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
    if squashed and isinstance(output, Tensor) and output.dtype == FLOAT:
        output = unary(conversion.context, "Tanh", np.tanh, output)
    if not isinstance(output, Tensor) or output.dtype != FLOAT:
        raise UserFault("graph_output")
    conversion.check_inputs()
    return conversion.context.emit.model(output)


class _Conversion:
    def __init__(
        self, graph: Graph, inputs: Sequence[InputSpec], limits: PackageLimits, caller: "_Conversion | None" = None
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
        """One output of a node, with an explicit stack, because a graph may be deeper than Python's."""
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
        inputs = [] if node.op in _SOURCES else [name for name, _ in node.inputs]
        return inputs + self._gates(node)

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
            made = converter(self.context, node, *alive)
            return [made] if isinstance(made, Known | Tensor) else made
        except Unsupported as error:
            fault = UserFault("graph_operation", operation=printable(node.op, 40), node=printable(node.name))
            raise fault from error
        except TooManyFields as error:
            raise UserFault("graph_too_big", limit=self.context.limits.wire_fields) from error
        except (Contradiction, WireError, ArithmeticError, TypeError, ValueError) as error:  # the latter are NumPy's
            raise UserFault("graph_invalid", node=printable(node.name)) from error

    def _call(self, node: TensorflowNode, values: list[Value]) -> None:
        """Enter a function or the branch that is taken. Its results are converted when they are read."""
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
        sensor = node.name.rsplit("/", 1)[-1]
        dtype = node.attributes.dtype("dtype")
        if dtype is not None and dtype.kind == "b":
            return Known(np.array(False))
        spec = self._specs.get(sensor) or self._specs.get(_SAME_CAMERA.get(sensor, ""))
        if spec is None:
            self._strangers.append(sensor)
            raise self._wrong_inputs()
        stored = node.attributes.shape("shape") or [-1] * len(spec.channels_last)
        shape = list(spec.channels_last)
        if len(stored) != len(shape) or any(size not in (-1, full) for size, full in zip(stored, shape, strict=True)):
            raise UserFault("onnx_input_shape", sensor=sensor, found=str(stored[:8]), expected=str(shape))
        if dtype not in (FLOAT, np.dtype("u1")):
            raise Contradiction
        sensor = spec.sensor
        if sensor not in self._read:
            stored_dtype = np.dtype("u1") if spec.is_picture else FLOAT
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


def find_policy(graph: Graph) -> tuple[TensorflowNode, bool]:
    """The policy's node, and whether tanh must follow it. Raises UserFault ``graph_output``.

    Found by the end of its name, because the scope before it differs between versions (``agent``, ``agent_0``); in a
    graph without such a name, the only node that nobody reads.
    """
    for suffix, squashed in _HEADS:
        found = [node for name, node in graph.nodes.items() if name == suffix or name.endswith("/" + suffix)]
        if len(found) == 1:
            return found[0], squashed and not _is_squashed(found[0], graph)
        if found:
            raise UserFault("graph_output")
    if len(graph.sinks) != 1:
        raise UserFault("graph_output")
    return graph.sinks[0], False


def _is_squashed(node: TensorflowNode | None, graph: Graph) -> bool:
    """Whether tanh is the last operation that changes the values, except for a clip."""
    seen = 0
    while node is not None and node.op in _PASS_ON and node.inputs and seen < len(graph.nodes):
        node, seen = graph.nodes.get(node.inputs[0][0]), seen + 1
    return node is not None and node.op == "Tanh"


@converts("Identity", "StopGradient", "PreventGradient", "CheckNumerics", "Snapshot", "ReadVariableOp")
@converts("PlaceholderWithDefault")  # training flags and keep probabilities: nothing feeds them when a car drives
def _pass_on(context: Context, node: TensorflowNode, value: Value) -> Value:
    return value


@converts("IdentityN")
def _pass_all_on(context: Context, node: TensorflowNode, *values: Value) -> list[Value]:
    require(bool(values))
    return list(values)


@converts("Const")
def _constant(context: Context, node: TensorflowNode) -> Value:
    return Known(node.attributes.tensor("value", context.limits))


@converts("Switch")
def _switch(context: Context, node: TensorflowNode, value: Value, flag: Value) -> list[Flow]:
    """Output 0 if the condition is false, output 1 if it is true. The condition (is_training) is frozen."""
    condition = known(flag)
    require(condition.dtype.kind == "b" and condition.size == 1)
    return [DEAD, value] if condition.reshape(-1)[0] else [value, DEAD]


@converts(*NOT_FROZEN)
def _not_frozen(context: Context, node: TensorflowNode, *values: Value) -> Value:
    raise UserFault("graph_not_frozen", node=node.op)
