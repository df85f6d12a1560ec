"""The ONNX layers with weights, windows and norms, in float64."""

# Meaning: onnx/docs/Operators.md. Weights become float64 where they are multiplied, those of a large layer in parts.

import math
from collections.abc import Callable

import numpy as np

from .model import Node

_PART = 1 << 17  # weights that are float64 at a time: 1 MB, the size of a cache


def _wide(x: np.ndarray) -> np.ndarray:
    return x.astype(np.float64) if x.dtype.kind == "f" and x.dtype != np.float64 else x


def _product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    if all(one.size <= _PART or one.dtype == np.float64 for one in (left, right)):
        return _wide(left) @ _wide(right)
    if right.size > left.size:  # a row times many columns
        step = max(1, _PART // max(1, right.shape[0]))
        parts = [_wide(left) @ _wide(right[:, at : at + step]) for at in range(0, right.shape[1], step)]
        return np.concatenate(parts, axis=1)
    step = max(1, _PART // max(1, left.shape[1]))
    return np.concatenate([_wide(left[at : at + step]) @ _wide(right) for at in range(0, left.shape[0], step)])


def _gemm(node: Node, a: np.ndarray, b: np.ndarray, c: np.ndarray | None = None) -> np.ndarray:
    a, b = (a.T if node.whole("transA", 0) else a), (b.T if node.whole("transB", 0) else b)
    # one row: in the order of the weights, in which each part is contiguous
    result = _product(b.T, a.T).T if a.shape[0] == 1 else _product(a, b)
    alpha, beta = node.real("alpha", 1.0), node.real("beta", 1.0)
    result = result if alpha == 1.0 else alpha * result
    return result if c is None else result + (_wide(c) if beta == 1.0 else beta * _wide(c))


def _matmul(_node: Node, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    if a.ndim == b.ndim == 2 and a.dtype.kind == "f":
        return _product(a, b)
    return np.matmul(_wide(a), _wide(b))


class Windows:
    """The windows over a picture: sizes, steps and edges along each axis of space."""

    def __init__(self, node: Node, space: tuple[int, ...], kernel: list[int]) -> None:
        rank = len(space)
        self.kernel = kernel
        self.strides = node.wholes("strides") or [1] * rank
        self.dilations = node.wholes("dilations") or [1] * rank
        pads = node.wholes("pads") or [0] * (2 * rank)
        self.before, self.after = list(pads[:rank]), list(pads[rank:])
        reach = [dilation * (size - 1) + 1 for dilation, size in zip(self.dilations, kernel, strict=True)]
        auto = node.text("auto_pad", "NOTSET")
        if auto == "VALID":
            self.before, self.after = [0] * rank, [0] * rank
        elif auto.startswith("SAME"):
            for axis, size in enumerate(space):
                stride = self.strides[axis]
                missing = max(0, (-(-size // stride) - 1) * stride + reach[axis] - size)
                small, large = missing // 2, missing - missing // 2
                self.before[axis], self.after[axis] = (small, large) if auto == "SAME_UPPER" else (large, small)
        self.counts = []
        for axis, size in enumerate(space):
            left = size + self.before[axis] + self.after[axis] - reach[axis]
            stride = self.strides[axis]
            count = left // stride + 1
            # with ceil_mode one more may begin within the picture or its first edge
            if node.whole("ceil_mode", 0) and left % stride and count * stride < size + self.before[axis]:
                count += 1
            self.counts.append(count)
        # the reach of the last windows beyond the picture and its edges
        ends = [(n - 1) * stride + r for n, stride, r in zip(self.counts, self.strides, reach, strict=True)]
        self.beyond = [
            max(0, end - size - low - high)
            for end, size, low, high in zip(ends, space, self.before, self.after, strict=True)
        ]
        self._reach = reach

    def of(self, x: np.ndarray, edge: float, beyond: float | None = None) -> np.ndarray:
        """A view ``[N, C, *counts, *kernel]`` of ``x`` with ``edge`` around it and ``beyond`` outside."""
        if any(self.before) or any(self.after):
            x = np.pad(x, [(0, 0), (0, 0), *zip(self.before, self.after, strict=True)], constant_values=edge)
        if any(self.beyond):
            more = [(0, 0), (0, 0), *((0, size) for size in self.beyond)]
            x = np.pad(x, more, constant_values=edge if beyond is None else beyond)
        axes = tuple(range(2, x.ndim))
        seen = np.lib.stride_tricks.sliding_window_view(x, tuple(self._reach), axis=axes)
        steps = [slice(0, (n - 1) * stride + 1, stride) for n, stride in zip(self.counts, self.strides, strict=True)]
        inner = [slice(None, None, dilation) for dilation in self.dilations]
        return seen[(slice(None), slice(None), *steps, *inner)]


def _conv(node: Node, x: np.ndarray, kernel: np.ndarray, bias: np.ndarray | None = None) -> np.ndarray:
    """One matrix product over the windows (im2col)."""
    groups = node.whole("group", 1)
    windows = Windows(node, x.shape[2:], list(kernel.shape[2:]))
    seen = windows.of(x, 0.0)
    count, filters, rank = x.shape[0], len(kernel), len(windows.kernel)
    each, taps = x.shape[1] // groups, math.prod(kernel.shape[1:])
    pixels = math.prod(windows.counts)
    order = (0, 1, *range(2 + rank, 2 + 2 * rank), *range(2, 2 + rank))
    columns = seen.transpose(order).reshape(count, groups, each * taps // kernel.shape[1], pixels)
    rows = kernel.reshape(groups, filters // groups, taps)
    result = np.stack(
        [np.concatenate([_product(rows[g], columns[n, g]) for g in range(groups)]) for n in range(count)]
    ).reshape(count, filters, *windows.counts)
    return result if bias is None else result + _channels(bias, result.ndim)


def _channels(values: np.ndarray, ndim: int) -> np.ndarray:
    """One value for each channel of ``[N, C, ...]``."""
    return _wide(values).reshape(-1, *[1] * (ndim - 2))


def _max_pool(node: Node, x: np.ndarray) -> np.ndarray:
    windows = Windows(node, x.shape[2:], node.wholes("kernel_shape") or [])
    lowest = -np.inf if x.dtype.kind == "f" else np.iinfo(x.dtype).min
    return windows.of(x, lowest).max(axis=tuple(range(x.ndim, 2 * x.ndim - 2)))


def _average_pool(node: Node, x: np.ndarray) -> np.ndarray:
    windows = Windows(node, x.shape[2:], node.wholes("kernel_shape") or [])
    axes = tuple(range(x.ndim, 2 * x.ndim - 2))
    counted = 1.0 if node.whole("count_include_pad", 0) else 0.0
    total = windows.of(x, 0.0).sum(axis=axes)
    return total / windows.of(np.ones((1, 1, *x.shape[2:])), counted, 0.0).sum(axis=axes)


def _over_space(function: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    return lambda _node, x: function(x, axis=tuple(range(2, x.ndim)), keepdims=True)


def _normal(x: np.ndarray, axes: tuple[int, ...], epsilon: float) -> np.ndarray:
    centred = x - x.mean(axis=axes, keepdims=True)
    return centred / np.sqrt((centred * centred).mean(axis=axes, keepdims=True) + epsilon)


def _batch_norm(
    node: Node, x: np.ndarray, scale: np.ndarray, bias: np.ndarray, mean: np.ndarray, variance: np.ndarray
) -> np.ndarray:
    scale, bias, mean, variance = (_channels(values, x.ndim) for values in (scale, bias, mean, variance))
    return (x - mean) / np.sqrt(variance + node.real("epsilon", 1e-5)) * scale + bias


def _instance_norm(node: Node, x: np.ndarray, scale: np.ndarray, bias: np.ndarray) -> np.ndarray:
    normal = _normal(x, tuple(range(2, x.ndim)), node.real("epsilon", 1e-5))
    return normal * _channels(scale, x.ndim) + _channels(bias, x.ndim)


def _layer_norm(node: Node, x: np.ndarray, scale: np.ndarray, bias: np.ndarray | None = None) -> np.ndarray:
    axis = node.whole("axis", -1) % x.ndim
    normal = _normal(x, tuple(range(axis, x.ndim)), node.real("epsilon", 1e-5)) * _wide(scale)
    return normal if bias is None else normal + _wide(bias)


def _group_norm(node: Node, x: np.ndarray, scale: np.ndarray, bias: np.ndarray) -> np.ndarray:
    groups, channels = node.whole("num_groups"), x.shape[1]
    grouped = x.reshape(x.shape[0], groups, -1)
    normal = _normal(grouped, (2,), node.real("epsilon", 1e-5)).reshape(x.shape)
    # one for each group until version 21, one for each channel since
    scale, bias = (np.repeat(_wide(v), channels // v.size) if v.size != channels else v for v in (scale, bias))
    return normal * _channels(scale, x.ndim) + _channels(bias, x.ndim)


LAYERS: dict[str, Callable[..., np.ndarray]] = {
    "Conv": _conv,
    "Gemm": _gemm,
    "MatMul": _matmul,
    "MaxPool": _max_pool,
    "AveragePool": _average_pool,
    "GlobalAveragePool": _over_space(np.mean),
    "GlobalMaxPool": _over_space(np.max),
    "BatchNormalization": _batch_norm,
    "InstanceNormalization": _instance_norm,
    "LayerNormalization": _layer_norm,
    "GroupNormalization": _group_norm,
}
