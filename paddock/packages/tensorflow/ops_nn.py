"""Converts layers: convolution, pooling, matrix products and batch normalisation."""

import numpy as np

from .emit import FLOAT, Known, Tensor, Value
from .graph import TensorflowNode
from .ops_math import unscaled
from .registry import Context, Unsupported, converts, known, require, tensor


def _spatial(node: TensorflowNode, name: str, default: list[int]) -> tuple[int, int]:
    """The height and width entries of a four-entry NHWC attribute."""
    values = node.attributes.integers(name, default)
    if node.attributes.text("data_format", "NHWC") != "NHWC":
        raise Unsupported
    require(len(values) == 4 and values[0] == values[3] == 1 and all(0 < value <= 4096 for value in values))
    return values[1], values[2]


def _window(
    node: TensorflowNode,
    size: tuple[int, ...],
    kernel: tuple[int, int],
    strides: tuple[int, int],
    dilations: tuple[int, int] = (1, 1),
) -> tuple[list[int], tuple[int, int]]:
    """ONNX pads and the output's height and width, by TensorFlow's padding rules (nn.convolution)."""
    padding, explicit = node.attributes.text("padding"), node.attributes.integers("explicit_paddings")
    if padding not in ("SAME", "VALID", "EXPLICIT"):
        raise Unsupported
    before, after, out = [], [], []
    for axis in range(2):
        reach = (kernel[axis] - 1) * dilations[axis] + 1
        first = last = 0
        if padding == "SAME":
            steps = -(-size[axis] // strides[axis])
            total = max((steps - 1) * strides[axis] + reach - size[axis], 0)
            first, last = total // 2, total - total // 2
        elif padding == "EXPLICIT":
            require(len(explicit) == 8 and all(0 <= pad <= 4096 for pad in explicit))
            first, last = explicit[2 + 2 * axis : 4 + 2 * axis]
        covered = size[axis] + first + last - reach
        require(covered >= 0)
        before.append(first)
        after.append(last)
        out.append(covered // strides[axis] + 1)
    return before + after, (out[0], out[1])


def _windows(kernel: tuple[int, int], strides: tuple[int, int], pads: list[int]) -> dict[str, list[int]]:
    return {"kernel_shape": list(kernel), "strides": list(strides)} | ({"pads": pads} if any(pads) else {})


@converts("Conv2D")
def _conv2d(context: Context, node: TensorflowNode, value: Value, weights: Value) -> Value:
    source, kernel = tensor(value), known(weights)
    require(len(source.shape) == 4 and kernel.ndim == 4 and source.dtype == kernel.dtype == FLOAT)
    height, width, depth, filters = kernel.shape
    require(depth == source.shape[3] and min(kernel.shape) > 0)
    strides = _spatial(node, "strides", [])
    dilations = _spatial(node, "dilations", [1, 1, 1, 1])
    pads, out = _window(node, source.shape[1:3], (height, width), strides, dilations)
    attributes = _windows((height, width), strides, pads)
    if dilations != (1, 1):
        attributes["dilations"] = list(dilations)
    # Pictures come as 0 to 255 and are divided first: a division of every pixel for one of every weight, here.
    source, factor = unscaled(context, source)
    if factor != 1.0:
        kernel = (kernel.astype(np.float64) * factor).astype(FLOAT)
    weight = np.ascontiguousarray(kernel.transpose(3, 2, 0, 1))
    shape = (source.shape[0], *out, filters)
    picture = context.emit.planar(source)
    extra = (weight, attributes)
    return context.emit.node("Conv", [picture, weight], shape, FLOAT, planar=True, extra=extra, **attributes)


@converts("MaxPool", "AvgPool")
def _pool(context: Context, node: TensorflowNode, value: Value) -> Value:
    source = tensor(value)
    require(len(source.shape) == 4 and source.dtype == FLOAT)
    kernel, strides = _spatial(node, "ksize", []), _spatial(node, "strides", [])
    pads, out = _window(node, source.shape[1:3], kernel, strides)
    shape = (source.shape[0], *out, source.shape[3])
    picture = context.emit.planar(source)
    attributes = _windows(kernel, strides, pads)
    op = "MaxPool" if node.op == "MaxPool" else "AveragePool"
    return context.emit.node(op, [picture], shape, FLOAT, planar=True, extra=(), **attributes)


@converts("MatMul")
def _matmul(context: Context, node: TensorflowNode, source: Value, weight: Value) -> Value:
    require(len(source.shape) == len(weight.shape) == 2 and source.dtype == weight.dtype == FLOAT)
    if not isinstance(source, Tensor) or node.attributes.flag("transpose_a"):
        raise Unsupported
    matrix = known(weight).T if node.attributes.flag("transpose_b") else known(weight)
    require(source.shape[1] == matrix.shape[0])
    matrix = np.ascontiguousarray(matrix)
    shape = (source.shape[0], matrix.shape[1])
    return context.emit.node("MatMul", [source, matrix], shape, extra=(matrix,))


@converts("FusedBatchNorm", "FusedBatchNormV2", "FusedBatchNormV3")
def _batch_norm(context: Context, node: TensorflowNode, value: Value, *parameters: Value) -> list[Value]:
    """Batch normalisation with the stored mean and variance. Its other outputs serve training only."""
    require(len(parameters) == 4)
    source = tensor(value)
    if node.attributes.flag("is_training", True) or node.attributes.text("data_format", "NHWC") != "NHWC":
        raise Unsupported
    statistics = [known(value) for value in parameters]
    require(len(source.shape) == 4 and source.dtype == FLOAT)
    require(all(array.shape == (source.shape[3],) and array.dtype == FLOAT for array in statistics))
    result = context.emit.node(
        "BatchNormalization",
        [context.emit.planar(source), *statistics],
        source.shape,
        planar=True,
        epsilon=node.attributes.real("epsilon", 1e-4),
    )
    return [result, *(Known(array) for array in statistics)]
