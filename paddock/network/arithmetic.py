"""The ONNX operators on single elements and on rows of them, in float64."""

# Meaning: onnx/docs/Operators.md. A function takes the node and its inputs (None for an omitted one) and returns the
# value, or a tuple of several.

import math
from collections.abc import Callable
from functools import reduce

import numpy as np

from .model import BOOL, DTYPES, FLOAT, FLOAT16, Node

Function = Callable[..., np.ndarray | tuple[np.ndarray, ...]]
_ERF = np.frompyfunc(math.erf, 1, 1)


def _erf(x: np.ndarray) -> np.ndarray:
    return np.asarray(_ERF(x), np.float64)


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-x))


def _softplus(x: np.ndarray) -> np.ndarray:
    return np.log1p(np.exp(-np.abs(x))) + np.maximum(x, 0.0)


def _gelu(node: Node, x: np.ndarray) -> np.ndarray:
    if node.text("approximate", "none") == "tanh":
        return 0.5 * x * (1.0 + np.tanh(math.sqrt(2.0 / math.pi) * (x + 0.044715 * x * x * x)))
    return 0.5 * x * (1.0 + _erf(x / math.sqrt(2.0)))


def _elu(node: Node, x: np.ndarray) -> np.ndarray:
    return np.where(x < 0, node.real("alpha", 1.0) * np.expm1(x), x)


def _celu(node: Node, x: np.ndarray) -> np.ndarray:
    alpha = node.real("alpha", 1.0)
    return np.maximum(x, 0.0) + np.minimum(alpha * np.expm1(x / alpha), 0.0)


def _selu(node: Node, x: np.ndarray) -> np.ndarray:
    alpha = node.real("alpha", 1.67326319217681884765625)
    return node.real("gamma", 1.05070102214813232421875) * np.where(x <= 0, alpha * np.expm1(x), x)


def _hard_sigmoid(node: Node, x: np.ndarray) -> np.ndarray:
    return np.clip(node.real("alpha", 0.2) * x + node.real("beta", 0.5), 0.0, 1.0)


def _clip(_node: Node, x: np.ndarray, low: np.ndarray | None = None, high: np.ndarray | None = None) -> np.ndarray:
    if low is not None:
        x = np.maximum(x, low)
    return x if high is None else np.minimum(x, high)


def cast(node: Node, x: np.ndarray) -> np.ndarray:
    """Floats stay float64, rounded to the precision of the type. Whole numbers out of a type's range become its
    ends."""
    target = node.whole("to")
    if target == BOOL:
        return x != 0
    if target in (FLOAT, FLOAT16):
        # floats stay exact as float32: its rounding is the approximation that is judged
        return x if x.dtype.kind == "f" and target == FLOAT else x.astype(DTYPES[target]).astype(np.float64)
    dtype = DTYPES[target]
    if x.dtype.kind != "f":
        return x.astype(dtype)
    ends = np.iinfo(dtype)
    whole = np.nan_to_num(np.trunc(x), nan=0.0)
    # the greatest float64 within, as the end itself may have none
    return np.clip(whole, float(ends.min), np.nextafter(float(ends.max) + 1.0, 0.0)).astype(dtype)


def _axes(node: Node, x: np.ndarray, given: np.ndarray | None) -> tuple[int, ...] | None:
    axes = node.wholes("axes") if given is None else [int(axis) for axis in given.reshape(-1)]
    if axes:
        return tuple(axes)
    return None if node.whole("noop_with_empty_axes", 0) else tuple(range(x.ndim))


def _reduce(function: Callable[..., np.ndarray]) -> Function:
    """A reduction; ``function(x, axis, keepdims)``."""

    def over(node: Node, x: np.ndarray, given: np.ndarray | None = None) -> np.ndarray:
        axes = _axes(node, x, given)
        return x if axes is None else function(x, axes, bool(node.whole("keepdims", 1)))

    return over


def _log_sum_exp(x: np.ndarray, axis: tuple[int, ...], keepdims: bool) -> np.ndarray:
    top = x.max(axis=axis, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    total = np.log(np.exp(x - top).sum(axis=axis, keepdims=True)) + top
    return total if keepdims else np.squeeze(total, axis)


ARITHMETIC: dict[str, Function] = {
    "Abs": lambda _, x: np.abs(x),
    "Neg": lambda _, x: -x,
    "Sqrt": lambda _, x: np.sqrt(x),
    "Reciprocal": lambda _, x: 1.0 / x,
    "Exp": lambda _, x: np.exp(x),
    "Log": lambda _, x: np.log(x),
    "Erf": lambda _, x: _erf(x),
    "Floor": lambda _, x: np.floor(x),
    "Ceil": lambda _, x: np.ceil(x),
    "Round": lambda _, x: np.rint(x),  # halves to the even one, by the standard
    "Sign": lambda _, x: np.sign(x),
    "Sigmoid": lambda _, x: _sigmoid(x),
    "Tanh": lambda _, x: np.tanh(x),
    "Relu": lambda _, x: np.maximum(x, 0),
    "Softplus": lambda _, x: _softplus(x),
    "Softsign": lambda _, x: x / (1.0 + np.abs(x)),
    "HardSwish": lambda _, x: x * np.clip(x / 6.0 + 0.5, 0.0, 1.0),
    "Mish": lambda _, x: x * np.tanh(_softplus(x)),
    "PRelu": lambda _, x, slope: np.where(x < 0, slope * x, x),
    "LeakyRelu": lambda node, x: np.where(x < 0, node.real("alpha", 0.01) * x, x),
    "Elu": _elu,
    "Celu": _celu,
    "Selu": _selu,
    "ThresholdedRelu": lambda node, x: np.where(x > node.real("alpha", 1.0), x, 0.0),
    "HardSigmoid": _hard_sigmoid,
    "Gelu": _gelu,
    "Clip": _clip,
    "Cast": cast,
    "Add": lambda _, one, other: one + other,
    "Sub": lambda _, one, other: one - other,
    "Mul": lambda _, one, other: one * other,
    "Div": lambda _, one, other: one / other,  # of floats alone, see the gate
    "Pow": lambda _, base, exponent: np.power(base, exponent.astype(np.float64)),
    "Min": lambda _, *values: reduce(np.minimum, values),
    "Max": lambda _, *values: reduce(np.maximum, values),
    "Sum": lambda _, *values: reduce(np.add, values),
    "Mean": lambda _, *values: reduce(np.add, values) / len(values),
    "Where": lambda _, is_so, one, other: np.where(is_so, one, other),
    "Equal": lambda _, one, other: one == other,
    "Less": lambda _, one, other: one < other,
    "Greater": lambda _, one, other: one > other,
    "LessOrEqual": lambda _, one, other: one <= other,
    "GreaterOrEqual": lambda _, one, other: one >= other,
    "And": lambda _, one, other: one & other,
    "Or": lambda _, one, other: one | other,
    "Not": lambda _, x: ~x,
    "ReduceMean": _reduce(lambda x, axis, keep: x.mean(axis=axis, keepdims=keep)),
    "ReduceSum": _reduce(lambda x, axis, keep: x.sum(axis=axis, keepdims=keep, dtype=x.dtype)),
    "ReduceMax": _reduce(lambda x, axis, keep: x.max(axis=axis, keepdims=keep)),
    "ReduceMin": _reduce(lambda x, axis, keep: x.min(axis=axis, keepdims=keep)),
    "ReduceL1": _reduce(lambda x, axis, keep: np.abs(x).sum(axis=axis, keepdims=keep)),
    "ReduceL2": _reduce(lambda x, axis, keep: np.sqrt((x * x).sum(axis=axis, keepdims=keep))),
    "ReduceSumSquare": _reduce(lambda x, axis, keep: (x * x).sum(axis=axis, keepdims=keep)),
    "ReduceLogSum": _reduce(lambda x, axis, keep: np.log(x.sum(axis=axis, keepdims=keep))),
    "ReduceLogSumExp": _reduce(_log_sum_exp),
}
