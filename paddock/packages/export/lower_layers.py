"""Lowers layers with weights, windows and norms to plain operations."""

# Meaning: onnx/docs/Operators.md.

import numpy as np

from paddock.network.layers import Windows
from paddock.network.model import Node

from .lower import Lowered, Lowering, OperandOrNone, Unsayable, lowers
from .lower_math import floats
from .plain import Const, Operand, Value

_LOWEST = float(np.finfo(np.float32).min)


def _in_two_dimensions(to: Lowering, x: Value) -> Value:
    """A row of pixels as a picture of one row."""
    if len(x.shape) == 3:
        return to.plain.reshape(x, (*x.shape[:2], 1, x.shape[2]))
    if len(x.shape) != 4:
        raise Unsayable
    return x


def _as_was(to: Lowering, result: Value, x: Value) -> Value:
    """Reshape to the number of axes of ``x``."""
    return result if len(x.shape) == 4 else to.plain.reshape(result, (*result.shape[:2], result.shape[3]))


def _edged(to: Lowering, picture: Value, windows: Windows, number: float) -> Value:
    """Pad with the edges of the windows."""
    lead = 4 - len(windows.before)
    after = [high + more for high, more in zip(windows.after, windows.beyond, strict=True)]
    return to.plain.pad(picture, [0] * lead + windows.before, [0] * lead + after, number)


@lowers("Conv")
def _conv(to: Lowering, node: Node, x: Value, kernel: OperandOrNone, bias: OperandOrNone = None) -> Lowered:
    if not isinstance(kernel, Const):
        raise Unsayable
    windows = Windows(node, x.shape[2:], list(kernel.shape[2:]))
    picture = _edged(to, _in_two_dimensions(to, x), windows, 0.0)
    if len(x.shape) == 3:
        kernel = kernel.reshaped((*kernel.shape[:2], 1, kernel.shape[2]))
    ones = [1] * (4 - len(x.shape))
    strides, dilations = [*ones, *windows.strides], [*ones, *windows.dilations]
    result = to.plain.conv(picture, kernel, strides, dilations, node.whole("group", 1))
    if bias is not None:
        result = to.plain.binary("add", result, _channels(bias, 4))
    return _as_was(to, result, x)


def _channels(values: OperandOrNone, rank: int) -> Const:
    """One number for each channel of ``[N, C, ...]``."""
    if not isinstance(values, Const):
        raise Unsayable
    return values.reshaped((1, values.array.size, *[1] * (rank - 2)))


@lowers("MaxPool", "AveragePool")
def _pool(to: Lowering, node: Node, x: Value) -> Lowered:
    kernel = node.wholes("kernel_shape") or []
    windows = Windows(node, x.shape[2:], kernel)
    if any(dilation != 1 for dilation in windows.dilations) or any(node.outputs[1:]):
        raise Unsayable
    ones = [1] * (4 - len(x.shape))
    sizes, strides = [*ones, *kernel], [*ones, *windows.strides]
    largest = node.op == "MaxPool"
    picture = _edged(to, _in_two_dimensions(to, x), windows, _LOWEST if largest else 0.0)
    result = to.plain.pool("max_pool" if largest else "mean_pool", picture, sizes, strides)
    if not largest and picture is not x:
        counted = 1.0 if node.whole("count_include_pad", 0) else 0.0
        axes = tuple(range(len(x.shape), 2 * len(x.shape) - 2))
        inside = windows.of(np.ones((1, 1, *x.shape[2:])), counted, 0.0).sum(axis=axes)
        share = floats(np.prod(kernel) / inside)
        if (share.array != 1).any():
            share = share if len(x.shape) == 4 else share.reshaped((1, 1, *ones, *share.shape[2:]))
            result = to.plain.binary("mul", result, share)
    return _as_was(to, result, x)


@lowers("GlobalAveragePool", "GlobalMaxPool")
def _over_space(to: Lowering, node: Node, x: Value) -> Lowered:
    return to.plain.reduce("most" if node.op == "GlobalMaxPool" else "mean", x, range(2, len(x.shape)), True)


@lowers("Gemm", value_first=False)
def _gemm(to: Lowering, node: Node, a: Operand, b: Operand, c: OperandOrNone = None) -> Lowered:
    result = to.plain.matmul(_turned(to, a, node.whole("transA", 0)), _turned(to, b, node.whole("transB", 0)))
    alpha, beta = node.real("alpha", 1.0), node.real("beta", 1.0)
    if alpha != 1.0:
        result = to.binary("mul", result, alpha)
    if c is not None:
        result = to.plain.binary("add", result, c if beta == 1.0 else to.binary("mul", c, beta))
    return result


def _turned(to: Lowering, x: Operand, turn: int) -> Operand:
    if not turn:
        return x
    return x.transposed((1, 0)) if isinstance(x, Const) else to.plain.transpose(x, (1, 0))


@lowers("MatMul", value_first=False)
def _matmul(to: Lowering, node: Node, left: Operand, right: Operand) -> Lowered:
    final = list(np.matmul(*(np.broadcast_to(np.zeros((), "f4"), one.shape) for one in (left, right))).shape)
    if len(left.shape) == 1:
        left = _shaped(to, left, (1, *left.shape))
    if len(right.shape) == 1:
        right = _shaped(to, right, (*right.shape, 1))
    return to.plain.reshape(to.plain.matmul(left, right), final)


def _shaped(to: Lowering, x: Operand, shape: tuple[int, ...]) -> Operand:
    return x.reshaped(shape) if isinstance(x, Const) else to.plain.reshape(x, shape)


# --- norms


@lowers("BatchNormalization")
def _batch_norm(to: Lowering, node: Node, x: Value, *statistics: Operand) -> Lowered:
    scale, bias, mean, variance = (to.known(one).astype(np.float64) for one in statistics)
    factor = scale / np.sqrt(variance + node.real("epsilon", 1e-5))
    shape = (1, factor.size, *[1] * (len(x.shape) - 2))
    product = to.plain.binary("mul", x, floats(factor.reshape(shape)))
    return to.plain.binary("add", product, floats((bias - mean * factor).reshape(shape)))


def _normal(to: Lowering, x: Value, axes: list[int], epsilon: float) -> Value:
    centred = to.plain.binary("sub", x, to.plain.reduce("mean", x, axes, True))
    spread = to.plain.reduce("mean", to.plain.binary("mul", centred, centred), axes, True)
    return to.plain.binary("div", centred, to.plain.unary("sqrt", to.binary("add", spread, epsilon)))


@lowers("InstanceNormalization")
def _instance_norm(to: Lowering, node: Node, x: Value, scale: Operand, bias: Operand) -> Lowered:
    rank = len(x.shape)
    normal = _normal(to, x, list(range(2, rank)), node.real("epsilon", 1e-5))
    scaled = to.plain.binary("mul", normal, _channels(scale, rank))
    return to.plain.binary("add", scaled, _channels(bias, rank))


@lowers("LayerNormalization")
def _layer_norm(to: Lowering, node: Node, x: Value, scale: Operand, bias: OperandOrNone = None) -> Lowered:
    if any(node.outputs[1:]):
        raise Unsayable
    axis = node.whole("axis", -1) % len(x.shape)
    normal = _normal(to, x, list(range(axis, len(x.shape))), node.real("epsilon", 1e-5))
    result = to.plain.binary("mul", normal, scale)
    return result if bias is None else to.plain.binary("add", result, bias)


@lowers("GroupNormalization")
def _group_norm(to: Lowering, node: Node, x: Value, scales: Operand, biases: Operand) -> Lowered:
    groups = node.whole("num_groups")
    grouped = to.plain.reshape(x, (x.shape[0], groups, int(np.prod(x.shape[1:])) // groups))
    normal = to.plain.reshape(_normal(to, grouped, [2], node.real("epsilon", 1e-5)), x.shape)
    # one for each group until version 21, one for each channel since
    scale, bias = (np.repeat(v, x.shape[1] // v.size) for v in (to.known(scales), to.known(biases)))
    shape = (1, -1, *[1] * (len(x.shape) - 2))
    scaled = to.plain.binary("mul", normal, floats(scale.reshape(shape)))
    return to.plain.binary("add", scaled, floats(bias.reshape(shape)))
