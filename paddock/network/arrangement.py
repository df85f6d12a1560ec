"""The ONNX operators that only rearrange numbers: shapes, slices and resized pictures."""

# Meaning: onnx/docs/Operators.md.

import math
from typing import Literal

import numpy as np

from .arithmetic import Function
from .model import Node


def _reshape(node: Node, x: np.ndarray, shape: np.ndarray) -> np.ndarray:
    zero_is_zero = node.whole("allowzero", 0)
    return x.reshape(
        [x.shape[place] if size == 0 and not zero_is_zero else size for place, size in enumerate(shape.tolist())]
    )


def _flatten(node: Node, x: np.ndarray) -> np.ndarray:
    axis = node.whole("axis", 1)
    axis += x.ndim if axis < 0 else 0
    return x.reshape(math.prod(x.shape[:axis]), -1)


def _squeeze(node: Node, x: np.ndarray, axes: np.ndarray | None = None) -> np.ndarray:
    given = node.wholes("axes") if axes is None else axes.tolist()
    return np.squeeze(x, None if given is None else tuple(given))


def _unsqueeze(node: Node, x: np.ndarray, axes: np.ndarray | None = None) -> np.ndarray:
    return np.expand_dims(x, tuple((node.wholes("axes") or []) if axes is None else axes.tolist()))


def _slice(
    _node: Node,
    x: np.ndarray,
    starts: np.ndarray,
    ends: np.ndarray,
    axes: np.ndarray | None = None,
    steps: np.ndarray | None = None,
) -> np.ndarray:
    places = [slice(None)] * x.ndim
    axes = np.arange(starts.size) if axes is None else axes
    steps = np.ones(starts.size, np.int64) if steps is None else steps
    for start, end, axis, step in zip(starts.tolist(), ends.tolist(), axes.tolist(), steps.tolist(), strict=True):
        size = x.shape[axis]
        start, end = (value + size if value < 0 else value for value in (start, end))
        if step > 0:
            places[axis] = slice(min(max(start, 0), size), min(max(end, 0), size), step)
        else:
            start, end = min(max(start, 0), size - 1), min(max(end, -1), size - 1)
            places[axis] = slice(start, None if end < 0 else end, step)
    return x[tuple(places)]


def _split(node: Node, x: np.ndarray, sizes: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
    axis = node.whole("axis", 0)
    given = node.wholes("split") if sizes is None else sizes.tolist()
    if not given:
        count = len(node.outputs)
        part = -(-x.shape[axis] // count)
        given = [min(part, x.shape[axis] - number * part) for number in range(count)]
    return tuple(np.split(x, np.cumsum(given)[:-1], axis))


def _shape(node: Node, x: np.ndarray) -> np.ndarray:
    return np.array(x.shape, np.int64)[node.whole("start", 0) : node.whole("end", x.ndim)]


def _constant_of_shape(node: Node, shape: np.ndarray) -> np.ndarray:
    value = node.array("value", np.zeros(1, np.float32)).reshape(-1)[0]
    return np.full(tuple(shape.tolist()), value, np.float64 if value.dtype.kind == "f" else value.dtype)


def _pad(
    node: Node, x: np.ndarray, pads: np.ndarray, value: np.ndarray | None = None, axes: np.ndarray | None = None
) -> np.ndarray:
    given = pads.tolist()
    wanted = list(range(x.ndim)) if axes is None else axes.tolist()
    before, after = [0] * x.ndim, [0] * x.ndim
    for place, axis in enumerate(wanted):
        before[axis], after[axis] = given[place], given[place + len(wanted)]
    # less than nothing is cut away
    cut = [slice(max(0, -low), size - max(0, -high)) for low, high, size in zip(before, after, x.shape, strict=True)]
    x = x[tuple(cut)]
    width = [(max(0, low), max(0, high)) for low, high in zip(before, after, strict=True)]
    mode = node.text("mode", "constant")
    if mode == "constant":
        return np.pad(x, width, constant_values=0 if value is None else value.reshape(-1)[0])
    return np.pad(x, width, _PADDING[mode])


_PADDING: dict[str, Literal["reflect", "edge", "wrap"]] = {"reflect": "reflect", "edge": "edge", "wrap": "wrap"}


def _depth_to_space(node: Node, x: np.ndarray) -> np.ndarray:
    block = node.whole("blocksize")
    count, depth, height, width = x.shape
    if node.text("mode", "DCR") == "DCR":
        x = x.reshape(count, block, block, depth // block**2, height, width).transpose(0, 3, 4, 1, 5, 2)
    else:
        x = x.reshape(count, depth // block**2, block, block, height, width).transpose(0, 1, 4, 2, 5, 3)
    return x.reshape(count, depth // block**2, height * block, width * block)


def _space_to_depth(node: Node, x: np.ndarray) -> np.ndarray:
    block = node.whole("blocksize")
    count, depth, height, width = x.shape
    x = x.reshape(count, depth, height // block, block, width // block, block).transpose(0, 3, 5, 1, 2, 4)
    return x.reshape(count, depth * block**2, height // block, width // block)


def _transpose(node: Node, x: np.ndarray) -> np.ndarray:
    return np.transpose(x, node.wholes("perm"))


def _gather(node: Node, x: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.take(x, places, node.whole("axis", 0))


def _expand(_node: Node, x: np.ndarray, shape: np.ndarray) -> np.ndarray:
    return np.broadcast_to(x, np.broadcast_shapes(x.shape, tuple(shape.tolist())))


ARRANGEMENT: dict[str, Function] = {
    "Identity": lambda _, x: x,
    "Concat": lambda node, *parts: np.concatenate(parts, node.whole("axis")),
    "Flatten": _flatten,
    "Reshape": _reshape,
    "Squeeze": _squeeze,
    "Unsqueeze": _unsqueeze,
    "Transpose": _transpose,
    "Slice": _slice,
    "Split": _split,
    "Gather": _gather,
    "Shape": _shape,
    "Expand": _expand,
    "ConstantOfShape": _constant_of_shape,
    "Pad": _pad,
    "DepthToSpace": _depth_to_space,
    "SpaceToDepth": _space_to_depth,
}
