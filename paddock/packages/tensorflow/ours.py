"""Recognises graphs that Paddock exported, and returns the original network."""

# A graph's mark is verified: the network that it names is exported again, and the mark counts only if the result equals
# the graph to the last byte. Any other graph is converted from its operations.

import json
from collections.abc import Sequence

import numpy as np

from paddock.errors import UserFault
from paddock.network import wire
from paddock.network.canonical import CanonicalNetwork, write_model
from paddock.network.model import read_model
from paddock.network.wire import TooManyFields, WireError
from paddock.packages.export import FORM, can_be_undone, exported
from paddock.packages.export.graphdef import MARK, Part
from paddock.packages.export.plain import Step
from paddock.packages.export.policy import Head
from paddock.packages.inputs import InputSpec
from paddock.packages.limits import PackageLimits

from .graph import Graph, TensorflowNode

_MOST_STEPS = 8
_ERRORS = (UserFault, WireError, TooManyFields, ValueError, KeyError, TypeError, IndexError, AttributeError)


def read_ours(data: bytes, graph: Graph, inputs: Sequence[InputSpec], limits: PackageLimits) -> bytes | None:
    """The canonical network of a graph that :func:`exported` wrote; None for every other graph."""
    marked = [node for node in graph.nodes.values() if MARK in node.attributes.raw]
    if len(marked) != 1:
        return None
    try:
        network, head = _named(_marked(marked[0]), graph, limits)
        parts = exported(network, {spec.sensor: spec for spec in inputs}, head)
    except _ERRORS:
        return None
    return write_model(network) if _is_joined(parts, memoryview(data)) else None


def _marked(node: TensorflowNode) -> bytes:
    for place, _, value in wire.fields(node.attributes.raw[MARK], node.attributes.budget):
        if place == 2:
            return bytes(wire.message(value))
    raise WireError("a mark of another kind")


def _named(mark: bytes, graph: Graph, limits: PackageLimits) -> tuple[CanonicalNetwork, Head]:
    """The network and the head in a mark."""
    line, _, onnx = mark.partition(b"\n")
    written = json.loads(line)
    if written["form"] != FORM:
        raise ValueError("another form")
    weights = {
        name: _undone(graph.nodes[node].attributes.tensor("value", limits), steps)
        for name, (node, steps) in written["weights"].items()
    }
    model = read_model(onnx, limits, weights)
    (output,) = model.outputs
    network = CanonicalNetwork(model.opset, model.inputs, output, model.nodes, model.weights)
    return network, Head(written["sac"] is True, written["scores"] is True)


def _undone(array: np.ndarray, steps: list[list]) -> bytes:
    if len(steps) > _MOST_STEPS:
        raise ValueError("too many steps")
    done = [Step(kind, tuple(int(number) for number in numbers)) for kind, *numbers in steps]
    if not can_be_undone(done):
        raise ValueError("steps that cannot be undone")
    for step in reversed(done):
        if step.kind == "transpose":
            array = array.transpose(np.argsort(step.numbers))
    return array.tobytes()


def _is_joined(parts: Sequence[Part], data: memoryview) -> bool:
    at = 0
    for part in parts:
        if data[at : at + len(part)] != part:
            return False
        at += len(part)
    return at == len(data)
