"""Operations on shapes and on the arrangement of values. With a batch of one most of them are known at once."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from .graph import Node
from .registry import Context, Unsupported, axes_of, converts, integers, known, require, tensor
from .values import Known, Tensor, Value


@converts("Shape")
def _shape(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    return [Known(np.array(inputs[0].shape, node.attributes.dtype("out_type") or np.int32))]


@converts("Size", "Rank")
def _size(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    shape = inputs[0].shape
    return [Known(np.array(math.prod(shape) if node.op == "Size" else len(shape), np.int32))]


@converts("Reshape")
def _reshape(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 2)
    source, wanted = inputs[0], integers(inputs[1])
    total = math.prod(source.shape)
    if -1 in wanted:
        rest = math.prod(size for size in wanted if size != -1)
        require(wanted.count(-1) == 1 and rest > 0 and total % rest == 0)
        wanted[wanted.index(-1)] = total // rest
    return [_reshaped(context, source, tuple(wanted))]


def _reshaped(context: Context, value: Value, shape: tuple[int, ...]) -> Value:
    require(all(size >= 0 for size in shape) and math.prod(shape) == math.prod(value.shape) and len(shape) <= 8)
    if isinstance(value, Known):
        return Known(value.array.reshape(shape))
    return context.emit.reshaped(tensor(value), shape)


@converts("ExpandDims")
def _expand_dims(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 2)
    shape = list(inputs[0].shape)
    (axis,) = axes_of(integers(inputs[1]), len(shape) + 1)
    return [_reshaped(context, inputs[0], (*shape[:axis], 1, *shape[axis:]))]


@converts("Squeeze")
def _squeeze(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    shape = inputs[0].shape
    axes = axes_of(node.attributes.integers("squeeze_dims") or node.attributes.integers("axis"), len(shape))
    axes = axes or [axis for axis, size in enumerate(shape) if size == 1]
    require(all(shape[axis] == 1 for axis in axes))
    return [_reshaped(context, inputs[0], tuple(size for axis, size in enumerate(shape) if axis not in axes))]


@converts("Transpose")
def _transpose(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 2)
    source, order = inputs[0], integers(inputs[1])
    require(sorted(order) == list(range(len(source.shape))))
    if order == list(range(len(order))):
        return [source]
    if isinstance(source, Known):
        return [Known(source.array.transpose(order))]
    shape = tuple(source.shape[axis] for axis in order)
    return [context.emit.node("Transpose", [context.emit.interleaved(source)], shape, source.dtype, perm=order)]


@converts("Pack")
def _pack(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(bool(inputs) and all(value.shape == inputs[0].shape for value in inputs))
    shape = list(inputs[0].shape)
    (axis,) = axes_of([node.attributes.integer("axis")], len(shape) + 1)
    single = (*shape[:axis], 1, *shape[axis:])
    return [_concatenate(context, [_reshaped(context, value, single) for value in inputs], axis)]


@converts("ConcatV2", "Concat")
def _concat(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) >= 2)
    values, axis = (inputs[:-1], inputs[-1]) if node.op == "ConcatV2" else (inputs[1:], inputs[0])
    (at,) = axes_of(integers(axis), len(values[0].shape))
    return [_concatenate(context, values, at)]


def _concatenate(context: Context, values: list[Value], axis: int) -> Value:
    first = values[0].shape
    for value in values:
        require(len(value.shape) == len(first) and value.dtype == values[0].dtype)
        require(all(a == b for at, (a, b) in enumerate(zip(value.shape, first, strict=True)) if at != axis))
    if len(values) == 1:
        return values[0]
    if all(isinstance(value, Known) for value in values):
        return Known(np.concatenate([known(value) for value in values], axis))
    shape = (*first[:axis], sum(value.shape[axis] for value in values), *first[axis + 1 :])
    if all(isinstance(value, Tensor) and value.planar for value in values):
        at = {0: 0, 1: 2, 2: 3, 3: 1}[axis]
        return context.emit.node("Concat", values, shape, values[0].dtype, planar=True, axis=at)
    flat = [context.emit.interleaved(value) if isinstance(value, Tensor) else value for value in values]
    return context.emit.node("Concat", flat, shape, values[0].dtype, axis=axis)


@converts("StridedSlice")
def _strided_slice(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 4)
    source = inputs[0]
    index = _python_index(node, [integers(value) for value in inputs[1:]], len(source.shape))
    if isinstance(source, Known):
        return [Known(np.asarray(_checked(lambda: source.array[index])))]
    # A view without memory has the same shapes as the real thing.
    ghost = np.broadcast_to(np.zeros((), np.uint8), source.shape)
    final = _checked(lambda: ghost[index]).shape
    starts, ends, steps, cut = [], [], [], []
    axis = 0
    for item in _without_ellipsis(index, len(source.shape)):
        if item is None:
            continue
        size = source.shape[axis]
        if isinstance(item, int):
            start = item + size if item < 0 else item
            start, end, step = start, start + 1, 1
        else:
            start, end, step = item.indices(size)
        if step < 0:
            raise Unsupported
        starts.append(start)
        ends.append(max(start, end))
        steps.append(step)
        cut.append(len(range(start, end, step)))
        axis += 1
    sliced = source
    if tuple(cut) != source.shape:
        plain = context.emit.interleaved(source)
        vectors = [np.array(v, np.int64) for v in (starts, ends, list(range(len(starts))), steps)]
        sliced = context.emit.node("Slice", [plain, *vectors], tuple(cut), source.dtype)
    return [_reshaped(context, sliced, tuple(final))]


def _python_index(node: Node, vectors: list[list[int]], rank: int) -> tuple:
    """TensorFlow's begin, end, strides and masks as a Python index."""
    begin, end, strides = vectors
    require(len(begin) == len(end) == len(strides) <= 8 and 0 not in strides)
    masks = {
        name: node.attributes.integer(f"{name}_mask")
        for name in ("begin", "end", "ellipsis", "new_axis", "shrink_axis")
    }
    index: list = []
    for at, (first, last, step) in enumerate(zip(begin, end, strides, strict=True)):
        bit = 1 << at
        if masks["ellipsis"] & bit:
            require(Ellipsis not in index)
            index.append(Ellipsis)
        elif masks["new_axis"] & bit:
            index.append(None)
        elif masks["shrink_axis"] & bit:
            index.append(first)
        else:
            index.append(
                slice(None if masks["begin"] & bit else first, None if masks["end"] & bit else last, step)
            )  # fmt: skip
    require(sum(item is not None and item is not Ellipsis for item in index) <= rank)
    return tuple(index)


def _without_ellipsis(index: tuple, rank: int) -> list:
    """The index with one entry for each axis of the source (and None for each new one)."""
    used = sum(item is not None and item is not Ellipsis for item in index)
    filler = [slice(None)] * (rank - used)
    if Ellipsis not in index:
        return [*index, *filler]
    at = index.index(Ellipsis)
    return [*index[:at], *filler, *index[at + 1 :]]


def _checked(take: Callable[[], np.ndarray]) -> np.ndarray:
    try:
        return take()
    except IndexError:
        require(False)
        raise


@converts("Slice")
def _slice(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 3)
    source, begin, size = inputs[0], integers(inputs[1]), integers(inputs[2])
    require(len(begin) == len(size) == len(source.shape))
    ends = [
        full if wanted == -1 else first + wanted for first, wanted, full in zip(begin, size, source.shape, strict=True)
    ]
    require(all(0 <= a <= b <= full for a, b, full in zip(begin, ends, source.shape, strict=True)))
    if isinstance(source, Known):
        return [Known(source.array[tuple(slice(a, b) for a, b in zip(begin, ends, strict=True))])]
    shape = tuple(b - a for a, b in zip(begin, ends, strict=True))
    if shape == source.shape:
        return [source]
    vectors = [np.array(v, np.int64) for v in (begin, ends, list(range(len(begin))))]
    return [context.emit.node("Slice", [context.emit.interleaved(source), *vectors], shape, source.dtype)]


@converts("GatherV2", "Gather")
def _gather(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    """Only of known values: TensorFlow gathers sizes out of shapes (tensordot)."""
    require(len(inputs) in (2, 3))
    source, indices = known(inputs[0]), known(inputs[1])
    (axis,) = axes_of(integers(inputs[2]) if len(inputs) == 3 else [0], source.ndim)
    require(indices.dtype.kind in "iu" and indices.size <= 64 and source.size <= 64)
    require(bool(np.all((indices >= 0) & (indices < source.shape[axis]))))
    return [Known(np.take(source, indices, axis))]


@converts("Fill")
def _fill(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 2)
    shape, value = integers(inputs[0]), known(inputs[1])
    require(value.size == 1 and all(size >= 0 for size in shape) and math.prod(shape) <= context.limits.tensor_elements)
    return [Known(np.broadcast_to(value.reshape(()), shape))]


@converts("Range")
def _range(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 3)
    start, limit, delta = (integers(value)[0] for value in inputs)
    require(delta != 0 and len(range(start, limit, delta)) <= 64)
    return [Known(np.arange(start, limit, delta, dtype=inputs[0].dtype))]


@converts("Tile")
def _tile(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 2)
    if any(times != 1 for times in integers(inputs[1])):
        raise Unsupported
    return [inputs[0]]


@converts("ZerosLike", "OnesLike")
def _like(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    value = inputs[0].dtype.type(node.op == "OnesLike")
    return [Known(np.broadcast_to(value, inputs[0].shape))]


@converts("Cast")
def _cast(context: Context, node: Node, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    source, wanted = inputs[0], node.attributes.dtype("DstT")
    if wanted is None:
        raise Unsupported
    if source.dtype == wanted:
        return [source]
    if isinstance(source, Known):
        return [Known(source.array.astype(wanted))]
    return [cast(context, tensor(source), wanted)]


def cast(context: Context, source: Tensor, wanted: np.dtype) -> Tensor:
    """Emit a cast, keeping the layout."""
    from onnx.helper import np_dtype_to_tensor_dtype

    number = np_dtype_to_tensor_dtype(wanted)
    return context.emit.node("Cast", [source], source.shape, wanted, planar=source.planar, to=number)
