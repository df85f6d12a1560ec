"""Our own graphs, read again as the very networks that they were written from.

Nobody has to believe a graph's mark: the network that it names is exported once more, and only if that gives the same
graph to the last byte is it the graph's own. Any other graph is converted from its operations.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from paddock.errors import UserFault
from paddock.network import wire
from paddock.network.canonical import CanonicalNetwork, write_model
from paddock.network.model import read_model
from paddock.network.wire import TooManyFields, WireError
from paddock.packages.export.graphdef import MARK, Part
from paddock.packages.export.marked import FORM, can_be_undone, exported
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
    """The network and its end that a mark speaks of."""
    line, _, onnx = mark.partition(b"\n")
    said = json.loads(line)
    if said["form"] != FORM:
        raise ValueError("another form")
    weights = {
        name: _undone(graph.nodes[node].attributes.tensor("value", limits), steps)
        for name, (node, steps) in said["weights"].items()
    }
    model = read_model(onnx, limits, weights)
    (output,) = model.outputs
    network = CanonicalNetwork(model.opset, model.inputs, output, model.nodes, model.weights)
    return network, Head(said["sac"] is True, said["scores"] is True)


def _undone(array: np.ndarray, steps: list[list]) -> bytes:
    """A weight's bytes as they were before these steps."""
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
    """Whether the parts, one after the other, are these bytes."""
    at = 0
    for part in parts:
        if data[at : at + len(part)] != part:
            return False
        at += len(part)
    return at == len(data)
