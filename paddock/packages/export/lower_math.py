"""Lowers arithmetic, activations and reductions to plain operations."""

# Meaning: onnx/docs/Operators.md.

import math
from collections.abc import Callable

import numpy as np

from paddock.network.model import DTYPES, Node

from .lower import Lowered, Lowering, OperandOrNone, Unsayable, lowers
from .plain import FLOAT, Const, Operand, Value

_SAME = {
    "Abs": "abs", "Neg": "neg", "Sqrt": "sqrt", "Exp": "exp", "Log": "log", "Erf": "erf", "Floor": "floor",
    "Ceil": "ceil", "Round": "round", "Sign": "sign", "Sigmoid": "sigmoid", "Tanh": "tanh", "Relu": "relu",
    "Softplus": "softplus", "Not": "not",
}  # fmt: skip
_TWO = {
    "Add": "add", "Sub": "sub", "Mul": "mul", "Div": "div", "And": "and", "Or": "or", "Equal": "equal", "Less": "less",
    "Greater": "greater", "LessOrEqual": "less_equal", "GreaterOrEqual": "greater_equal",
}  # fmt: skip
_MANY = {"Min": "min", "Max": "max", "Sum": "add"}


@lowers(*_SAME)
def _unary(to: Lowering, node: Node, x: Value) -> Lowered:
    return to.plain.unary(_SAME[node.op], x)


@lowers(*_TWO, value_first=False)
def _binary(to: Lowering, node: Node, left: Operand, right: Operand) -> Lowered:
    return to.plain.binary(_TWO[node.op], left, right)


@lowers("Pow", value_first=False)
def _pow(to: Lowering, node: Node, base: Operand, exponent: Operand) -> Lowered:
    if exponent.dtype != base.dtype:
        exponent = Const(to.known(exponent).astype(base.dtype))
    return to.plain.binary("pow", base, exponent)


@lowers(*_MANY, "Mean", value_first=False)
def _many(to: Lowering, node: Node, *parts: Operand) -> Lowered:
    result = parts[0]
    for part in parts[1:]:
        result = to.plain.binary(_MANY.get(node.op, "add"), result, part)
    return result if node.op != "Mean" else to.binary("div", result, float(len(parts)))


@lowers("Where", value_first=False)
def _where(to: Lowering, node: Node, condition: Operand, one: Operand, other: Operand) -> Lowered:
    return to.plain.where(condition, one, other)


@lowers("Clip", value_first=False)
def _clip(to: Lowering, node: Node, x: Operand, low: OperandOrNone = None, high: OperandOrNone = None) -> Lowered:
    x = x if low is None else to.plain.binary("max", x, low)
    return x if high is None else to.plain.binary("min", x, high)


@lowers("Cast")
def _cast(to: Lowering, node: Node, x: Value) -> Lowered:
    wanted = DTYPES[node.whole("to")]
    if wanted == np.float16:
        raise Unsayable  # half precision rounds elsewhere in every runtime
    return x if x.dtype == wanted else to.plain.cast(x, wanted)


Shape = Callable[[Lowering, Node, Value], Operand]


def _elu(to: Lowering, x: Value, alpha: float, within: float = 1.0) -> Value:
    """``alpha (e^(x/within) - 1)`` below zero, ``x`` above."""
    low = to.binary("min", x, 0.0)
    low = low if within == 1.0 else to.binary("div", low, within)
    bent = to.binary("mul", to.binary("sub", to.plain.unary("exp", low), 1.0), alpha)
    return to.binary("add", bent, to.plain.unary("relu", x))


def _between(to: Lowering, x: Value) -> Value:
    return to.binary("min", to.binary("max", x, 0.0), 1.0)


def _slope(to: Lowering, x: Value, alpha: float) -> Value:
    return to.plain.where(to.binary("less", x, 0.0), to.binary("mul", x, alpha), x)


def _gelu(to: Lowering, node: Node, x: Value) -> Operand:
    if node.text("approximate", "none") == "tanh":
        cube = to.binary("mul", to.plain.binary("mul", x, x), x)
        inner = to.binary("mul", to.binary("add", to.binary("mul", cube, 0.044715), x), math.sqrt(2 / math.pi))
        gate = to.plain.unary("tanh", inner)
    else:
        gate = to.plain.unary("erf", to.binary("div", x, math.sqrt(2.0)))
    return to.binary("mul", to.plain.binary("mul", x, to.binary("add", gate, 1.0)), 0.5)


_SHAPES: dict[str, Shape] = {
    "Reciprocal": lambda to, _, x: to.binary("div", 1.0, x),
    "Softsign": lambda to, _, x: to.plain.binary("div", x, to.binary("add", to.plain.unary("abs", x), 1.0)),
    "HardSwish": lambda to, _, x: to.plain.binary(
        "mul", x, _between(to, to.binary("add", to.binary("div", x, 6.0), 0.5))
    ),
    "Mish": lambda to, _, x: to.plain.binary("mul", x, to.plain.unary("tanh", to.plain.unary("softplus", x))),
    "LeakyRelu": lambda to, node, x: _slope(to, x, node.real("alpha", 0.01)),
    "Elu": lambda to, node, x: _elu(to, x, node.real("alpha", 1.0)),
    "Celu": lambda to, node, x: _elu(to, x, node.real("alpha", 1.0), node.real("alpha", 1.0)),
    "Selu": lambda to, node, x: to.binary(
        "mul", _elu(to, x, node.real("alpha", 1.67326319217681884765625)), node.real("gamma", 1.05070102214813232421875)
    ),
    "ThresholdedRelu": lambda to, node, x: to.plain.where(
        to.binary("greater", x, node.real("alpha", 1.0)), x, to.number(0.0)
    ),
    "HardSigmoid": lambda to, node, x: _between(
        to, to.binary("add", to.binary("mul", x, node.real("alpha", 0.2)), node.real("beta", 0.5))
    ),
    "Gelu": _gelu,
}


@lowers(*_SHAPES)
def _activation(to: Lowering, node: Node, x: Value) -> Lowered:
    return _SHAPES[node.op](to, node, x)


@lowers("PRelu")
def _prelu(to: Lowering, node: Node, x: Value, slope: Operand) -> Lowered:
    return to.plain.where(to.binary("less", x, 0.0), to.plain.binary("mul", slope, x), x)


# --- over axes


@lowers("Softmax", "LogSoftmax")
def _softmax(to: Lowering, node: Node, x: Value) -> Lowered:
    rank = len(x.shape)
    if to.opset < 13:  # all behind the axis, as one row
        axis = node.whole("axis", 1) % rank
        flat = to.plain.reshape(x, (math.prod(x.shape[:axis]), math.prod(x.shape[axis:])))
        return to.plain.reshape(_over_last(to, node.op, flat), x.shape)
    axis = node.whole("axis", -1) % rank
    if axis == rank - 1:
        return _over_last(to, node.op, x)
    order = [at for at in range(rank) if at != axis] + [axis]
    return to.plain.transpose(_over_last(to, node.op, to.plain.transpose(x, order)), np.argsort(order).tolist())


def _over_last(to: Lowering, op: str, x: Value) -> Value:
    if op == "Softmax":
        return to.plain.softmax(x)
    return to.plain.binary("sub", x, _log_sum_exp(to, x, [len(x.shape) - 1], True))


def _log_sum_exp(to: Lowering, x: Value, axes: list[int], keep: bool) -> Value:
    top = to.plain.reduce("most", x, axes, True)
    total = to.plain.reduce("sum", to.plain.unary("exp", to.plain.binary("sub", x, top)), axes, True)
    result = to.plain.binary("add", to.plain.unary("log", total), top)
    if keep:
        return result
    gone = {axis % len(x.shape) for axis in axes}
    return to.plain.reshape(result, [size for at, size in enumerate(x.shape) if at not in gone])


_REDUCE = {"ReduceMean": "mean", "ReduceSum": "sum", "ReduceMax": "most", "ReduceMin": "least"}


@lowers(*_REDUCE, *(f"Reduce{kind}" for kind in ("L1", "L2", "SumSquare", "LogSum", "LogSumExp")))
def _reduce(to: Lowering, node: Node, x: Value, given: OperandOrNone = None) -> Lowered:
    axes = node.wholes("axes") if given is None else to.known(given).reshape(-1).tolist()
    if not axes:
        if node.whole("noop_with_empty_axes", 0):
            return x
        axes = list(range(len(x.shape)))
    keep = bool(node.whole("keepdims", 1))
    if node.op in _REDUCE:
        return to.plain.reduce(_REDUCE[node.op], x, axes, keep)
    if node.op == "ReduceLogSumExp":
        return _log_sum_exp(to, x, axes, keep)
    if node.op == "ReduceL1":
        x = to.plain.unary("abs", x)
    elif node.op != "ReduceLogSum":
        x = to.plain.binary("mul", x, x)
    total = to.plain.reduce("sum", x, axes, keep)
    last = {"ReduceL2": "sqrt", "ReduceLogSum": "log"}.get(node.op)
    return total if last is None else to.plain.unary(last, total)


def floats(array: np.ndarray) -> Const:
    return Const(np.ascontiguousarray(array, FLOAT))
