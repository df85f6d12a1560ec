"""Operations on shapes and on the arrangement of values. With a batch of one most of them are known at once."""

from __future__ import annotations

import math

import numpy as np

from .graph import TensorflowNode
from .registry import Context, Contradiction, Unsupported, axes_of, converts, integers, known, require, tensor
from .values import Known, Tensor, Value


@converts("Shape")
def _shape(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    return [Known(np.array(inputs[0].shape, node.attributes.dtype("out_type") or np.int32))]


@converts("Reshape")
def _reshape(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
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


@converts("Squeeze")
def _squeeze(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    shape = inputs[0].shape
    axes = axes_of(node.attributes.integers("squeeze_dims") or node.attributes.integers("axis"), len(shape))
    axes = axes or [axis for axis, size in enumerate(shape) if size == 1]
    require(all(shape[axis] == 1 for axis in axes))
    return [_reshaped(context, inputs[0], tuple(size for axis, size in enumerate(shape) if axis not in axes))]


@converts("Transpose")
def _transpose(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
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
def _pack(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    require(bool(inputs) and all(value.shape == inputs[0].shape for value in inputs))
    shape = list(inputs[0].shape)
    (axis,) = axes_of([node.attributes.integer("axis")], len(shape) + 1)
    single = (*shape[:axis], 1, *shape[axis:])
    return [_concatenate(context, [_reshaped(context, value, single) for value in inputs], axis)]


@converts("ConcatV2")
def _concat(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    require(len(inputs) >= 2)
    *values, axis = inputs
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
def _strided_slice(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    """The first of the outermost axis, or a part of a known shape. Of what depends on the sensors nothing is cut off:
    a batch is one."""
    require(len(inputs) == 4)
    source = inputs[0]
    index = _python_index(node, [integers(value) for value in inputs[1:]], len(source.shape))
    try:
        if isinstance(source, Known):
            return [Known(np.asarray(source.array[index]))]
        # A view without memory has the same shapes as the real thing.
        final = np.broadcast_to(np.zeros((), np.uint8), source.shape)[index].shape
    except IndexError as error:
        raise Contradiction from error
    if math.prod(final) != math.prod(source.shape):
        raise Unsupported
    return [_reshaped(context, source, final)]


def _python_index(node: TensorflowNode, vectors: list[list[int]], rank: int) -> tuple[int | slice, ...]:
    """TensorFlow's begin, end, strides and masks as a Python index."""
    begin, end, strides = vectors
    require(len(begin) == len(end) == len(strides) <= rank and 0 not in strides)
    if node.attributes.integer("ellipsis_mask") or node.attributes.integer("new_axis_mask") or min(strides) < 0:
        raise Unsupported
    index: list[int | slice] = []
    for at, (first, last, step) in enumerate(zip(begin, end, strides, strict=True)):
        masked = {name: node.attributes.integer(f"{name}_mask") >> at & 1 for name in ("begin", "end", "shrink_axis")}
        if masked["shrink_axis"]:
            index.append(first)
        else:
            index.append(slice(None if masked["begin"] else first, None if masked["end"] else last, step))
    return tuple(index)


@converts("GatherV2")
def _gather(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    """Only of known values: TensorFlow gathers sizes out of shapes (tensordot)."""
    require(len(inputs) == 3)
    source, indices = known(inputs[0]), known(inputs[1])
    (axis,) = axes_of(integers(inputs[2]), source.ndim)
    require(indices.dtype.kind in "iu" and indices.size <= 64 and source.size <= 64)
    require(bool(np.all((indices >= 0) & (indices < source.shape[axis]))))
    return [Known(np.take(source, indices, axis))]


def cast(context: Context, source: Tensor, wanted: np.dtype) -> Tensor:
    """Emit a cast, keeping the layout."""
    from onnx.helper import np_dtype_to_tensor_dtype

    number = np_dtype_to_tensor_dtype(wanted)
    return context.emit.node("Cast", [source], source.shape, wanted, planar=source.planar, to=number)
