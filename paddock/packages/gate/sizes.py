"""Folds the size arithmetic that torch writes in front of Pad, Expand and Resize."""

# ``F.pad`` and ``Tensor.expand`` become a dozen operations on a handful of integers. Shape inference does not follow
# all of them, and a car need not repeat them in every step. Only networks with one of the operators in :data:`SIZED`
# are changed: no such network was accepted before, and all others keep their canonical bytes.

from collections.abc import Callable

import numpy as np

from paddock.network.canonical import CanonicalNetwork, canonicalise
from paddock.network.model import DTYPES, Model, Node

SIZED = {"ConstantOfShape", "Expand", "Pad", "Resize"}
_MOST = 64  # numbers in one value


def fold_sizes(network: CanonicalNetwork) -> CanonicalNetwork:
    """The network with its small whole-number constants computed; unchanged without one of :data:`SIZED`."""
    if not any(node.op in SIZED for node in network.nodes):
        return network
    left = []
    for node in network.nodes:
        result = _computed(node, network.weights)
        if result is None:
            left.append(node)
        else:
            network.weights[node.outputs[0]] = result
    if len(left) == len(network.nodes):
        return network
    return canonicalise(Model(network.opset, left, network.weights, network.inputs, [network.output]))


def _computed(node: Node, weights: dict[str, np.ndarray]) -> np.ndarray | None:
    """The node's only output, if it is small and known; else None, and the node stays as it is."""
    function = _FUNCTIONS.get(node.op)
    values = [weights.get(name) for name in node.inputs]
    if function is None or not values or len(node.outputs) != 1:
        return None
    if any(value is None or value.size > _MOST or value.dtype.kind not in "ib" for value in values):
        return None
    try:
        result = np.asarray(function(node, *values))
    except (ValueError, IndexError, TypeError, OverflowError, KeyError):
        return None  # sizes that do not fit: shape inference reports them
    return result if result.size <= _MOST and result.dtype.kind in "ib" else None


def _constant_of_shape(node: Node, shape: np.ndarray) -> np.ndarray:
    value = node.array("value", np.zeros(1, np.float32))
    if shape.ndim != 1 or (shape < 0).any() or np.prod(shape.astype(float)) > _MOST:
        raise ValueError
    return np.full(tuple(shape), value.reshape(-1)[0], value.dtype)


def _slice(_node: Node, data: np.ndarray, starts: np.ndarray, ends: np.ndarray, *more: np.ndarray) -> np.ndarray:
    axes = more[0] if more else np.arange(starts.size)
    steps = more[1] if len(more) > 1 else np.ones(starts.size, np.int64)
    places = [slice(None)] * data.ndim
    for start, end, axis, step in zip(starts, ends, axes, steps, strict=True):
        last = int(end) if step > 0 or end >= -data.shape[axis] else None  # before the first: to the very beginning
        places[axis] = slice(int(start), last, int(step))
    return data[tuple(places)]


def _reshape(_node: Node, data: np.ndarray, shape: np.ndarray) -> np.ndarray:
    wanted = [data.shape[place] if size == 0 else int(size) for place, size in enumerate(shape)]
    return data.reshape(wanted)


def _unsqueeze(node: Node, data: np.ndarray, *axes: np.ndarray) -> np.ndarray:
    return np.expand_dims(data, tuple(int(axis) for axis in (axes[0] if axes else node.wholes("axes") or ())))


def _squeeze(node: Node, data: np.ndarray, *axes: np.ndarray) -> np.ndarray:
    given = axes[0] if axes else node.wholes("axes")
    return np.squeeze(data, None if given is None else tuple(int(axis) for axis in given))


def _where(_node: Node, is_so: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.where(is_so, one, other)


_FUNCTIONS: dict[str, Callable[..., np.ndarray]] = {
    "ConstantOfShape": _constant_of_shape,
    "Slice": _slice,
    "Reshape": _reshape,
    "Unsqueeze": _unsqueeze,
    "Squeeze": _squeeze,
    "Concat": lambda node, *parts: np.concatenate(parts, node.whole("axis")),
    "Gather": lambda node, data, places: np.take(data, places, node.whole("axis", 0)),
    "Transpose": lambda node, data: np.transpose(data, node.wholes("perm")),
    "Cast": lambda node, data: data.astype(DTYPES[node.whole("to")]),
    "Shape": lambda node, data: np.array(data.shape, np.int64)[node.whole("start", 0) : node.whole("end", data.ndim)],
    "Add": lambda _node, one, other: one + other,
    "Sub": lambda _node, one, other: one - other,
    "Mul": lambda _node, one, other: one * other,
    "Equal": lambda _node, one, other: one == other,
    "Where": _where,
}
