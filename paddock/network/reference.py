"""Computes a network in float64 with numpy, with the same result on every processor."""

# The order of sums of the runtime's kernels depends on the processor. This evaluator has one order, and an error of
# about 2^-29 of float32's; with the pins of :mod:`paddock.exact` its results are the same to the bit on every machine.

from collections.abc import Mapping

import numpy as np

from .arithmetic import ARITHMETIC, Function
from .arrangement import ARRANGEMENT
from .canonical import CanonicalNetwork
from .layers import LAYERS
from .model import FLOAT, Node
from .resize import resize

_SMALL = 1 << 17
_KEPT = 8_000_000  # the most weights that are cached as float64: 64 MB
_IN_PARTS = ("Conv", "Gemm", "MatMul")  # they widen large weights themselves, a part at a time


class Reference:
    """One network, computed in float64. Later runs are faster."""

    def __init__(self, network: CanonicalNetwork) -> None:
        """Raises KeyError for an unknown operator."""
        self._network = network
        self._wide: dict[str, np.ndarray] = {}
        self._left, self._runs = _KEPT, 0
        self._functions = [self._function(node.op) for node in network.nodes]
        self._last = {name: place for place, node in enumerate(network.nodes) for name in node.inputs}

    def _function(self, op: str) -> Function:
        opset = self._network.opset
        if op in ("Softmax", "LogSoftmax"):
            exponential = ARITHMETIC["ReduceLogSumExp"]

            def soft(node: Node, x: np.ndarray) -> np.ndarray:
                # before opset 13 all axes from the given one on, as one row
                axes = [node.whole("axis", -1)] if opset >= 13 else [*range(node.whole("axis", 1) % x.ndim, x.ndim)]
                row = Node("ReduceLogSumExp", [], [], {"axes": axes, "keepdims": 1})
                logs = x - exponential(row, x)
                return np.exp(logs) if op == "Softmax" else logs

            return soft
        if op == "Resize":
            return resize
        return LAYERS.get(op) or ARRANGEMENT.get(op) or ARITHMETIC[op]

    def run(self, feeds: Mapping[str, np.ndarray]) -> np.ndarray:
        """The output, float64, of inputs by name in their dtypes and shapes. Raises what numpy raises."""
        return self._run(feeds, None)

    def steps(self, feeds: Mapping[str, np.ndarray]) -> bool:
        """Whether an operator makes a step out of a slope (rounds, compares or casts floats): there the smallest error
        may become a large one."""
        found: list[str] = []
        self._run(feeds, found)
        return bool(found)

    def run_with_steps(self, feeds: Mapping[str, np.ndarray]) -> tuple[np.ndarray, bool]:
        """Both at once; the output is that of a run that is not the first."""
        self._runs += 1
        found: list[str] = []
        return self._run(feeds, found), bool(found)

    def _run(self, feeds: Mapping[str, np.ndarray], found: list[str] | None) -> np.ndarray:
        self._runs += 1
        values: dict[str, np.ndarray] = {}
        for name, array in feeds.items():
            values[name] = array.astype(np.float64) if array.dtype.kind == "f" else array
        with np.errstate(all="ignore"):
            for place, (node, function) in enumerate(zip(self._network.nodes, self._functions, strict=True)):
                parts = node.op in _IN_PARTS
                inputs = [self._value(values, name, parts) if name else None for name in node.inputs]
                if found is not None and _is_step(node, inputs):
                    found.append(node.op)
                made = function(node, *inputs)
                results = made if isinstance(made, tuple) else (made,)
                values.update((name, result) for name, result in zip(node.outputs, results, strict=False) if name)
                for name in node.inputs:
                    if self._last[name] == place and name != self._network.output.name:
                        values.pop(name, None)
        return np.asarray(values[self._network.output.name], np.float64)

    def _value(self, values: dict[str, np.ndarray], name: str, in_parts: bool) -> np.ndarray:
        """A value, or a weight as float64; a large weight unchanged for operators that widen it ``in_parts``."""
        if name in values:
            return values[name]
        if name in self._wide:
            return self._wide[name]
        array = self._network.weights[name]
        if array.dtype.kind != "f":
            return array
        if array.size <= self._left and (array.size <= _SMALL or self._runs > 1):
            self._left -= array.size
            self._wide[name] = array.astype(np.float64)
            return self._wide[name]
        return array if in_parts else array.astype(np.float64)


_STEPS = {
    *("Floor", "Ceil", "Round", "Sign", "ThresholdedRelu"),
    *("Equal", "Less", "Greater", "LessOrEqual", "GreaterOrEqual"),
}


def _is_step(node: Node, inputs: list[np.ndarray | None]) -> bool:
    floats = any(value is not None and value.dtype.kind == "f" for value in inputs)
    if node.op == "Cast":
        return floats and node.whole("to") != FLOAT
    return floats and node.op in _STEPS
