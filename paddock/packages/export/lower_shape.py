"""Lowers operators that only rearrange numbers to plain operations."""

# Meaning: onnx/docs/Operators.md.

import math

import numpy as np

from paddock.network.arrangement import ARRANGEMENT
from paddock.network.model import Node
from paddock.network.resize import matrices

from .lower import Lowered, Lowering, OperandOrNone, Unsayable, lowers
from .lower_math import floats
from .plain import Operand, Value


def _shape_of(node: Node, x: Value, *given: np.ndarray | None) -> tuple[int, ...]:
    """The shape of an operator's result, computed on an array without memory."""
    return np.asarray(ARRANGEMENT[node.op](node, np.broadcast_to(np.zeros((), "?"), x.shape), *given)).shape


@lowers("Identity")
def _identity(to: Lowering, node: Node, x: Value) -> Lowered:
    return x


@lowers("Reshape", "Flatten", "Squeeze", "Unsqueeze")
def _reshape(to: Lowering, node: Node, x: Value, *given: OperandOrNone) -> Lowered:
    return to.plain.reshape(x, _shape_of(node, x, *to.arrays(*given)))


@lowers("Transpose")
def _transpose(to: Lowering, node: Node, x: Value) -> Lowered:
    return to.plain.transpose(x, node.wholes("perm") or range(len(x.shape))[::-1])


@lowers("Concat", value_first=False)
def _concat(to: Lowering, node: Node, *parts: Operand) -> Lowered:
    return to.plain.concat(parts, node.whole("axis") % len(parts[0].shape))


@lowers("Slice")
def _slice(to: Lowering, node: Node, x: Value, starts: Operand, *more: OperandOrNone) -> Lowered:
    given = to.arrays(starts, *more)
    axes = range(to.known(starts).size) if len(given) < 3 or given[2] is None else given[2].tolist()
    for axis in {int(axis) % len(x.shape) for axis in axes}:
        x = to.plain.take(x, axis, _lines(node, x, axis, *given))
    return x


def _lines(node: Node, x: Value, axis: int, *given: np.ndarray | None) -> np.ndarray:
    """The kept lines of one axis, in their order."""
    numbers = np.arange(x.shape[axis]).reshape([-1 if at == axis else 1 for at in range(len(x.shape))])
    moved = np.asarray(ARRANGEMENT[node.op](node, np.broadcast_to(numbers, x.shape), *given))
    return moved[tuple(slice(None) if at == axis else 0 for at in range(moved.ndim))]


@lowers("Split")
def _split(to: Lowering, node: Node, x: Value, given: OperandOrNone = None) -> Lowered:
    axis, (sizes,) = node.whole("axis", 0) % len(x.shape), to.arrays(given)
    numbers = np.arange(x.shape[axis]).reshape([-1 if at == axis else 1 for at in range(len(x.shape))])
    parts = ARRANGEMENT["Split"](node, numbers, sizes)
    return tuple(to.plain.take(x, axis, part.reshape(-1)) for part in parts)


@lowers("Gather")
def _gather(to: Lowering, node: Node, x: Value, given: Operand) -> Lowered:
    axis, places = node.whole("axis", 0) % len(x.shape), to.known(given)
    lines = np.where(places < 0, places + x.shape[axis], places)
    found = to.plain.take(x, axis, lines)
    return to.plain.reshape(found, (*x.shape[:axis], *places.shape, *x.shape[axis + 1 :]))


@lowers("Expand")
def _expand(to: Lowering, node: Node, x: Value, shape: Operand) -> Lowered:
    return to.plain.broadcast(x, np.broadcast_shapes(x.shape, tuple(to.known(shape).tolist())))


@lowers("Pad")
def _pad(
    to: Lowering, node: Node, x: Value, sides: Operand, fills: OperandOrNone = None, along: OperandOrNone = None
) -> Lowered:
    pads, (number, axes) = to.known(sides), to.arrays(fills, along)
    rank = len(x.shape)
    wanted = list(range(rank)) if axes is None else [int(axis) % rank for axis in axes.tolist()]
    before, after = [0] * rank, [0] * rank
    for place, axis in enumerate(wanted):
        before[axis], after[axis] = int(pads[place]), int(pads[place + len(wanted)])
    constant = node.text("mode", "constant") == "constant"
    for axis in wanted:  # less than nothing is cut away; other edges are lines of the picture itself
        if constant and before[axis] >= 0 and after[axis] >= 0:
            continue
        width = np.array([before[axis], after[axis]]) if not constant else np.minimum([before[axis], after[axis]], 0)
        row = Node("Pad", [], [], {"mode": node.text("mode", "constant")})
        x = to.plain.take(x, axis, np.asarray(ARRANGEMENT["Pad"](row, np.arange(x.shape[axis]), width)))
    if not constant:
        return x
    fill = 0.0 if number is None or not number.size else float(number.reshape(-1)[0])
    return to.plain.pad(x, [max(0, size) for size in before], [max(0, size) for size in after], fill)


@lowers("DepthToSpace", "SpaceToDepth")
def _blocks(to: Lowering, node: Node, x: Value) -> Lowered:
    block, (count, depth, height, width) = node.whole("blocksize"), x.shape
    if node.op == "SpaceToDepth":
        parts = (count, depth, height // block, block, width // block, block)
        apart = to.plain.transpose(to.plain.reshape(x, parts), (0, 3, 5, 1, 2, 4))
        return to.plain.reshape(apart, (count, depth * block**2, height // block, width // block))
    least = depth // block**2
    if node.text("mode", "DCR") == "DCR":
        parts, order = (count, block, block, least, height, width), (0, 3, 4, 1, 5, 2)
    else:
        parts, order = (count, least, block, block, height, width), (0, 1, 4, 2, 5, 3)
    apart = to.plain.transpose(to.plain.reshape(x, parts), order)
    return to.plain.reshape(apart, (count, least, height * block, width * block))


@lowers("Resize")
def _resize(to: Lowering, node: Node, x: Value, *given: OperandOrNone) -> Lowered:
    """Along each axis a product with a matrix, which has the share of each old line in each new one."""
    found = matrices(node, x.shape, *to.arrays(*given))
    if found is None:
        raise Unsayable
    for axis, matrix in found.items():
        if ((matrix == 0) | (matrix == 1)).all() and (matrix.sum(axis=1) == 1).all():
            x = to.plain.take(x, axis, matrix.argmax(axis=1))
            continue
        rank = len(x.shape)
        order = [at for at in range(rank) if at != axis] + [axis]
        turned = to.plain.transpose(x, order)
        rows = to.plain.reshape(turned, (math.prod(turned.shape[:-1]), turned.shape[-1]))
        made = to.plain.reshape(to.plain.matmul(rows, floats(matrix.T)), (*turned.shape[:-1], len(matrix)))
        x = to.plain.transpose(made, np.argsort(order).tolist())
    return x
