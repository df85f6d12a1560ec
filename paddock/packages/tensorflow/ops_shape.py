"""Converts operations on shapes and on the arrangement of values."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from paddock.network.written import NUMBERS

from .emit import Known, Tensor, Value
from .graph import TensorflowNode
from .registry import Context, Contradiction, Unsupported, axes_of, axis_of, converts, integers, known, require, tensor

_MOST_PARTS = 64
_DOUBLE = 11  # TensorProto.DataType: the one type of a graph that the gate refuses


@converts("Shape")
def _shape(context: Context, node: TensorflowNode, source: Value) -> Value:
    return Known(np.array(source.shape, node.attributes.dtype("out_type") or np.int32))


@converts("Size", "Rank")
def _size(context: Context, node: TensorflowNode, source: Value) -> Value:
    return Known(np.array(math.prod(source.shape) if node.op == "Size" else len(source.shape), np.int32))


@converts("Reshape")
def _reshape(context: Context, node: TensorflowNode, source: Value, shape: Value) -> Value:
    wanted = integers(shape)
    total = math.prod(source.shape)
    if -1 in wanted:
        rest = math.prod(size for size in wanted if size != -1)
        require(wanted.count(-1) == 1 and rest > 0 and total % rest == 0)
        wanted[wanted.index(-1)] = total // rest
    return _reshaped(context, source, tuple(wanted))


def _reshaped(context: Context, value: Value, shape: tuple[int, ...]) -> Value:
    require(all(size >= 0 for size in shape) and math.prod(shape) == math.prod(value.shape) and len(shape) <= 8)
    if isinstance(value, Known):
        return Known(value.array.reshape(shape))
    return context.emit.reshaped(tensor(value), shape)


@converts("ExpandDims")
def _expand_dims(context: Context, node: TensorflowNode, source: Value, place: Value) -> Value:
    axis = axis_of(place, len(source.shape) + 1)
    return _reshaped(context, source, (*source.shape[:axis], 1, *source.shape[axis:]))


@converts("Squeeze")
def _squeeze(context: Context, node: TensorflowNode, source: Value) -> Value:
    shape = source.shape
    axes = axes_of(node.attributes.integers("squeeze_dims") or node.attributes.integers("axis"), len(shape))
    axes = axes or [axis for axis, size in enumerate(shape) if size == 1]
    require(all(shape[axis] == 1 for axis in axes))
    return _reshaped(context, source, tuple(size for axis, size in enumerate(shape) if axis not in axes))


@converts("Transpose")
def _transpose(context: Context, node: TensorflowNode, source: Value, perm: Value) -> Value:
    order = integers(perm)
    require(sorted(order) == list(range(len(source.shape))))
    if order == list(range(len(order))):
        return source
    if isinstance(source, Known):
        return Known(source.array.transpose(order))
    shape = tuple(source.shape[axis] for axis in order)
    return context.emit.node("Transpose", [context.emit.interleaved(source)], shape, source.dtype, perm=order)


@converts("Pack")
def _pack(context: Context, node: TensorflowNode, *inputs: Value) -> Value:
    require(bool(inputs) and all(value.shape == inputs[0].shape for value in inputs))
    shape = list(inputs[0].shape)
    (axis,) = axes_of([node.attributes.integer("axis")], len(shape) + 1)
    single = (*shape[:axis], 1, *shape[axis:])
    return _concatenate(context, [_reshaped(context, value, single) for value in inputs], axis)


@converts("Concat", "ConcatV2")
def _concat(context: Context, node: TensorflowNode, *inputs: Value) -> Value:
    require(len(inputs) >= 2)
    values, axis = (inputs[:-1], inputs[-1]) if node.op == "ConcatV2" else (inputs[1:], inputs[0])
    return _concatenate(context, values, axis_of(axis, len(values[0].shape)))


def _concatenate(context: Context, values: Sequence[Value], axis: int) -> Value:
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
def _strided_slice(
    context: Context, node: TensorflowNode, source: Value, begin: Value, end: Value, strides: Value
) -> Value:
    index = _python_index(node, integers(begin), integers(end), integers(strides), len(source.shape))
    try:
        if isinstance(source, Known):
            return Known(np.asarray(source.array[tuple(index)]))
        # A view without memory has the same shapes as the real thing.
        final = np.broadcast_to(np.zeros((), np.uint8), source.shape)[tuple(index)].shape
    except IndexError as error:
        raise Contradiction from error
    return _reshaped(context, _cut(context, source, _without_ellipsis(index, len(source.shape))), final)


def _python_index(node: TensorflowNode, begin: list[int], end: list[int], strides: list[int], rank: int) -> list[Any]:
    """TensorFlow's begin, end, strides and masks as a Python index; masks count in TensorFlow's order."""
    require(len(begin) == len(end) == len(strides) <= 8 and 0 not in strides)
    names = ("begin", "end", "ellipsis", "new_axis", "shrink_axis")
    masks = {name: node.attributes.integer(f"{name}_mask") for name in names}
    index: list[Any] = []
    for at, (first, last, step) in enumerate(zip(begin, end, strides, strict=True)):
        masked = {name for name in names if masks[name] >> at & 1}
        if "ellipsis" in masked:
            require(Ellipsis not in index)
            index.append(Ellipsis)
        elif "new_axis" in masked:
            index.append(None)
        elif "shrink_axis" in masked:
            index.append(first)
        else:
            index.append(slice(None if "begin" in masked else first, None if "end" in masked else last, step))
    require(sum(item is not None and item is not Ellipsis for item in index) <= rank)
    return index


def _without_ellipsis(index: list[Any], rank: int) -> list[Any]:
    """The index with one entry for each axis of the source."""
    used = [item for item in index if item is not None]
    rest = [slice(None)] * (rank - len(used) + (Ellipsis in used))
    if Ellipsis not in used:
        return [*used, *rest]
    at = used.index(Ellipsis)
    return [*used[:at], *rest, *used[at + 1 :]]


def _cut(context: Context, value: Value, index: list[Any]) -> Value:
    """The part of a value that one slice or position for each axis names; a position keeps its axis, of size one."""
    ranges = []
    for item, size in zip(index, value.shape, strict=True):
        first = item + size if isinstance(item, int) and item < 0 else item
        ranges.append(range(*item.indices(size)) if isinstance(item, slice) else range(first, first + 1))
    shape = tuple(len(numbers) for numbers in ranges)
    if isinstance(value, Known):
        return Known(value.array[tuple(slice(one.start, one.stop, one.step) for one in ranges)])
    if any(numbers.step < 0 for numbers in ranges):
        raise Unsupported
    if shape == value.shape:
        return value
    starts, ends = ([getattr(one, end) for one in ranges] for end in ("start", "stop"))
    ends = [max(start, end) for start, end in zip(starts, ends, strict=True)]
    vectors = (starts, ends, list(range(len(ranges))), [one.step for one in ranges])
    parts = [np.array(numbers, np.int64) for numbers in vectors]
    return context.emit.node("Slice", [context.emit.interleaved(value), *parts], shape, value.dtype)


@converts("Slice")
def _slice(context: Context, node: TensorflowNode, source: Value, begin: Value, sizes: Value) -> Value:
    index = []
    for first, wanted, full in zip(integers(begin), integers(sizes), source.shape, strict=True):
        last = full if wanted == -1 else first + wanted
        require(0 <= first <= last <= full)
        index.append(slice(first, last))
    return _cut(context, source, index)


@converts("Split")
def _split(context: Context, node: TensorflowNode, axis: Value, source: Value) -> list[Value]:
    count, at = node.attributes.integer("num_split"), axis_of(axis, len(source.shape))
    require(0 < count <= _MOST_PARTS and source.shape[at] % count == 0)
    return _parts(context, source, at, [source.shape[at] // count] * count)


@converts("SplitV")
def _split_v(context: Context, node: TensorflowNode, source: Value, wanted: Value, axis: Value) -> list[Value]:
    sizes, at = integers(wanted), axis_of(axis, len(source.shape))
    require(0 < len(sizes) == node.attributes.integer("num_split") <= _MOST_PARTS and sizes.count(-1) <= 1)
    rest = source.shape[at] - sum(sizes) - 1
    return _parts(context, source, at, [rest if size == -1 else size for size in sizes])


@converts("Unpack")
def _unpack(context: Context, node: TensorflowNode, source: Value) -> list[Value]:
    shape = source.shape
    (axis,) = axes_of([node.attributes.integer("axis")], len(shape))
    require(shape[axis] <= _MOST_PARTS)
    parts = _parts(context, source, axis, [1] * shape[axis])
    return [_reshaped(context, part, (*shape[:axis], *shape[axis + 1 :])) for part in parts]


def _parts(context: Context, value: Value, axis: int, sizes: list[int]) -> list[Value]:
    require(all(size >= 0 for size in sizes) and sum(sizes) == value.shape[axis])
    index: list[Any] = [slice(None)] * len(value.shape)
    parts, start = [], 0
    for size in sizes:
        index[axis] = slice(start, start + size)
        parts.append(_cut(context, value, index))
        start += size
    return parts


@converts("Gather", "GatherV2")
def _gather(context: Context, node: TensorflowNode, value: Value, places: Value, *along: Value) -> Value:
    """Only of known values: TensorFlow gathers sizes out of shapes (tensordot)."""
    source, indices = known(value), known(places)
    require(source.ndim > 0 and len(along) == (node.op == "GatherV2"))
    axis = axis_of(along[0], source.ndim) if along else 0
    require(indices.dtype.kind in "iu" and indices.size <= 64 and source.size <= 64)
    require(bool(np.all((indices >= 0) & (indices < source.shape[axis]))))
    return Known(np.take(source, indices, axis))


@converts("Fill")
def _fill(context: Context, node: TensorflowNode, sizes: Value, number: Value) -> Value:
    shape, value = integers(sizes), known(number)
    require(value.size == 1 and len(shape) <= 8 and all(size >= 0 for size in shape))
    require(math.prod(shape) <= context.limits.tensor_elements)
    return Known(np.broadcast_to(value.reshape(()), shape))


@converts("Range")
def _range(context: Context, node: TensorflowNode, *inputs: Value) -> Value:
    require(len(inputs) == 3 and all(math.prod(value.shape) == 1 for value in inputs))
    start, limit, delta = (integers(value)[0] for value in inputs)
    require(delta != 0 and len(range(start, limit, delta)) <= 64)
    return Known(np.arange(start, limit, delta, dtype=inputs[0].dtype))


@converts("Tile")
def _tile(context: Context, node: TensorflowNode, source: Value, multiples: Value) -> Value:
    """Only once along each axis: a repetition for each picture of a batch of one."""
    if any(times != 1 for times in integers(multiples)):
        raise Unsupported
    return source


@converts("ZerosLike", "OnesLike")
def _like(context: Context, node: TensorflowNode, source: Value) -> Value:
    return Known(np.broadcast_to(np.array(node.op == "OnesLike", source.dtype), source.shape))


@converts("Cast")
def _cast(context: Context, node: TensorflowNode, source: Value) -> Value:
    wanted = node.attributes.dtype("DstT")
    if wanted is None:
        raise Unsupported
    if source.dtype == wanted:
        return source
    if isinstance(source, Known):
        with np.errstate(all="ignore"):
            return Known(source.array.astype(wanted))
    return cast(context, source, wanted)


def cast(context: Context, source: Tensor, wanted: np.dtype) -> Tensor:
    """Emit a cast, keeping the layout."""
    number = NUMBERS.get(wanted.str[1:], _DOUBLE)
    return context.emit.node("Cast", [source], source.shape, wanted, planar=source.planar, to=number)
