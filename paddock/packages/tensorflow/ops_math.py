"""Converts arithmetic and activations, and computes known values in the graph's precision."""

import math
from collections.abc import Callable
from functools import reduce

import numpy as np

from .emit import FLOAT, Known, Tensor, Value
from .graph import TensorflowNode
from .registry import Context, Unsupported, axes_of, converts, integers, require, tensor

_BINARY: dict[str, tuple[str, Callable]] = {
    "Add": ("Add", np.add),
    "AddV2": ("Add", np.add),
    "Sub": ("Sub", np.subtract),
    "Mul": ("Mul", np.multiply),
    "RealDiv": ("Div", np.true_divide),
    "Div": ("Div", np.true_divide),
    "Maximum": ("Max", np.maximum),
    "Minimum": ("Min", np.minimum),
    "Pow": ("Pow", np.power),
}
# ONNX's name, and what computes a known value (None: only of what depends on the sensors)
_UNARY: dict[str, tuple[str, Callable | None]] = {
    "Neg": ("Neg", np.negative),
    "Abs": ("Abs", np.abs),
    "Exp": ("Exp", np.exp),
    "Log": ("Log", np.log),
    "Sqrt": ("Sqrt", np.sqrt),
    "Reciprocal": ("Reciprocal", lambda x: 1 / x),
    "Inv": ("Reciprocal", lambda x: 1 / x),
    "Relu": ("Relu", lambda x: np.maximum(x, 0)),
    "Tanh": ("Tanh", np.tanh),
    "Sigmoid": ("Sigmoid", lambda x: 1 / (1 + np.exp(-x))),
    "Softplus": ("Softplus", lambda x: np.logaddexp(x, 0)),
    "Softsign": ("Softsign", lambda x: x / (1 + np.abs(x))),
    "Selu": ("Selu", None),
    "Elu": ("Elu", None),
    "LeakyRelu": ("LeakyRelu", None),
}
_REDUCTIONS: dict[str, tuple[str, Callable]] = {
    "Mean": ("ReduceMean", np.mean),
    "Sum": ("ReduceSum", np.sum),
    "Max": ("ReduceMax", np.max),
    "Min": ("ReduceMin", np.min),
    "Prod": ("", np.prod),  # of known shapes only (tensordot)
}
# Numbers that may be multiplied into weights: none of the weights' digits is lost for their size.
_LEAST_SCALE, _MOST_SCALE = 2.0**-24, 2.0**24
_PLANAR_AXES = {0: 0, 1: 2, 2: 3, 3: 1}


@converts(*_BINARY)
def _binary(context: Context, node: TensorflowNode, left: Value, right: Value) -> Value:
    return binary(context, node.op, left, right)


def binary(context: Context, op: str, left: Value, right: Value) -> Value:
    """An element-wise operation with broadcasting. Adding zero and multiplying by one or zero leave no trace."""
    require(left.dtype == right.dtype)
    shape = np.broadcast_shapes(left.shape, right.shape)
    onnx_op, compute = _BINARY[op]
    if isinstance(left, Known) and isinstance(right, Known):
        require(math.prod(shape) <= context.limits.tensor_elements)
        if op == "Div" and left.dtype.kind in "iu":
            raise Unsupported
        with np.errstate(all="ignore"):
            return Known(np.asarray(compute(left.array, right.array)).astype(left.dtype))
    if left.dtype != FLOAT:
        raise Unsupported
    if (shortcut := _shortcut(onnx_op, left, right, shape)) is not None:
        return shortcut
    if onnx_op == "Add" and (fused := _with_bias(context, left, right, shape)) is not None:
        return fused
    pictures = [value for value in (left, right) if isinstance(value, Tensor) and value.planar]
    scale = _scale(onnx_op, left, right)
    extra = () if scale is None else (scale,)
    if not pictures:
        return context.emit.node(onnx_op, [left, right], shape, extra=extra)
    if any(isinstance(value, Tensor) and len(value.shape) != 4 for value in (left, right)) or len(shape) != 4:
        flat = [context.emit.interleaved(value) if isinstance(value, Tensor) else value for value in (left, right)]
        return context.emit.node(onnx_op, flat, shape)
    planar = [_planar(context, value) for value in (left, right)]
    return context.emit.node(onnx_op, planar, shape, planar=True, extra=extra)


def _scale(op: str, left: Value, right: Value) -> float | None:
    """The single factor of a multiplication, in double precision; None for anything else."""
    if op == "Mul" and isinstance(left, Known):
        left, right = right, left
    if op not in ("Mul", "Div") or not isinstance(right, Known) or right.array.size != 1:
        return None
    number = float(right.array.reshape(()))
    if not _LEAST_SCALE <= abs(number) <= _MOST_SCALE:
        return None
    return number if op == "Mul" else 1.0 / number


def unscaled(context: Context, value: Tensor) -> tuple[Tensor, float]:
    """The tensor that ``value`` is a multiple of, and the factor; an unread multiplication is dropped later."""
    factor = 1.0
    while True:
        op, sources, extra = context.emit.made_by(value)
        if op not in ("Mul", "Div") or len(extra) != 1 or sources[0].shape != value.shape:
            return value, factor
        if not _LEAST_SCALE <= abs(factor * extra[0]) <= _MOST_SCALE:
            return value, factor
        value, factor = sources[0], factor * extra[0]


def _shortcut(op: str, left: Value, right: Value, shape: tuple[int, ...]) -> Value | None:
    """``x+0``, ``x-0``, ``x*1``, ``x/1`` are x; ``x*0`` is zero. RL-Coach scales gradients with such terms."""
    for value, other, is_left in ((right, left, False), (left, right, True)):
        if not isinstance(value, Known) or (is_left and op in ("Sub", "Div")):
            continue
        zero, one = not value.array.any(), bool(np.all(value.array == 1))
        same = other.shape == shape
        if same and ((zero and op in ("Add", "Sub")) or (one and op in ("Mul", "Div"))):
            return other
        if zero and op == "Mul":
            return Known(np.broadcast_to(np.zeros((), FLOAT), shape))
    return None


def _with_bias(context: Context, left: Value, right: Value, shape: tuple[int, ...]) -> Tensor | None:
    """Put a bias into the convolution or matrix product that it follows."""
    for product, bias in ((left, right), (right, left)):
        if not isinstance(product, Tensor) or not isinstance(bias, Known) or product.shape != shape:
            continue
        width = shape[-1] if shape else 0
        if bias.array.size != width or not bias.shape or bias.shape[-1] != width:
            continue
        op, sources, extra = context.emit.made_by(product)
        row = np.ascontiguousarray(bias.array.reshape(width))
        if op == "MatMul" and len(shape) == 2 and len(extra) == 1:
            return context.emit.node("Gemm", [sources[0], extra[0], row], shape)
        if op == "Conv" and len(extra) == 2:
            kernel, attributes = extra
            return context.emit.node("Conv", [sources[0], kernel, row], shape, planar=True, **attributes)
    return None


def _planar(context: Context, value: Value) -> Tensor | np.ndarray:
    if isinstance(value, Tensor):
        return context.emit.planar(value)
    array = value.array
    if array.size == 1:
        return array.reshape(())
    return array.reshape((1,) * (4 - array.ndim) + array.shape).transpose(0, 3, 1, 2)


@converts("BiasAdd")
def _bias_add(context: Context, node: TensorflowNode, value: Value, bias: Value) -> Value:
    require(len(bias.shape) == 1)
    if node.attributes.text("data_format", "NHWC") != "NHWC":
        raise Unsupported
    require(value.shape[-1:] == bias.shape)
    return binary(context, "Add", value, bias)


@converts("AddN")
def _add_n(context: Context, node: TensorflowNode, *values: Value) -> Value:
    return reduce(lambda total, value: binary(context, "Add", total, value), values)


@converts(*_UNARY)
def _unary(context: Context, node: TensorflowNode, value: Value) -> Value:
    onnx_op, compute = _UNARY[node.op]
    if node.op == "LeakyRelu":
        source = _floats(value)
        alpha = node.attributes.real("alpha", 0.2)
        return context.emit.node(onnx_op, [source], source.shape, planar=source.planar, alpha=alpha)
    return unary(context, onnx_op, compute, value)


def unary(context: Context, op: str, compute: Callable | None, value: Value) -> Value:
    if isinstance(value, Known) and compute is not None:
        with np.errstate(all="ignore"):
            return Known(np.asarray(compute(value.array)).astype(value.dtype))
    source = _floats(value)
    return context.emit.node(op, [source], source.shape, planar=source.planar)


def _floats(value: Value) -> Tensor:
    source = tensor(value)
    if source.dtype != FLOAT:
        raise Unsupported
    return source


@converts("Rsqrt")
def _rsqrt(context: Context, node: TensorflowNode, value: Value) -> Value:
    return unary(context, "Reciprocal", lambda x: 1 / x, unary(context, "Sqrt", np.sqrt, value))


@converts("Square")
def _square(context: Context, node: TensorflowNode, value: Value) -> Value:
    return binary(context, "Mul", value, value)


@converts("SquaredDifference")
def _squared_difference(context: Context, node: TensorflowNode, left: Value, right: Value) -> Value:
    return _square(context, node, binary(context, "Sub", left, right))


@converts("Relu6")
def _relu6(context: Context, node: TensorflowNode, value: Value) -> Value:
    return _clip(context, node, value, Known(np.array(0, FLOAT)), Known(np.array(6, FLOAT)))


@converts("ClipByValue")
def _clip(context: Context, node: TensorflowNode, value: Value, low: Value, high: Value) -> Value:
    return binary(context, "Maximum", binary(context, "Minimum", value, high), low)


@converts("Softmax", "LogSoftmax")
def _softmax(context: Context, node: TensorflowNode, value: Value) -> Value:
    source = context.emit.interleaved(tensor(value))
    require(len(source.shape) >= 1)
    return context.emit.node(node.op, [source], source.shape, axis=-1)


@converts(*_REDUCTIONS)
def _reduce(context: Context, node: TensorflowNode, value: Value, over: Value) -> Value:
    onnx_op, compute = _REDUCTIONS[node.op]
    keep = node.attributes.flag("keep_dims")
    axes = axes_of(integers(over), len(value.shape))
    if isinstance(value, Known):
        require(node.op in ("Sum", "Prod") or value.array.size > 0)
        result = compute(value.array, axis=tuple(axes), keepdims=keep)
        return Known(np.asarray(result).astype(value.dtype))
    source = _floats(value)
    if not onnx_op:
        raise Unsupported
    if not axes:
        return source
    kept = tuple(1 if axis in axes else size for axis, size in enumerate(source.shape))
    stored = sorted(_PLANAR_AXES[axis] if source.planar else axis for axis in axes)
    if onnx_op == "ReduceSum":  # its axes are an input since opset 13
        over_axes = np.array(stored, np.int64)
        reduced = context.emit.node(onnx_op, [source, over_axes], kept, planar=source.planar, keepdims=1)
    else:
        reduced = context.emit.node(onnx_op, [source], kept, planar=source.planar, axes=stored, keepdims=1)
    if keep:
        return reduced
    final = tuple(size for axis, size in enumerate(source.shape) if axis not in axes)
    return context.emit.reshaped(reduced, final)
