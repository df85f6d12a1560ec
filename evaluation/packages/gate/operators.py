"""The operators a car's network may use, with the attributes each may have.

Left out on purpose: control flow (Loop, If, Scan), anything random, anything whose output may be far larger than its
input (Expand, Tile, Range, ConstantOfShape, Resize, Pad, OneHot), strings, sequences, and recurrent layers (a policy
has no memory between steps here). Reasons: platforms.md B.5 and B.6.
"""

from __future__ import annotations

import numpy as np

from evaluation.packages.wire import printable
from faults import UserFault

from .model import DTYPES, Attribute, Node

_I, _F, _S, _IS, _FS, _T = int, float, str, "ints", "floats", np.ndarray
_POOL = {"auto_pad": _S, "ceil_mode": _I, "dilations": _IS, "kernel_shape": _IS, "pads": _IS, "strides": _IS}
_REDUCE = {"axes": _IS, "keepdims": _I, "noop_with_empty_axes": _I}

OPERATORS: dict[str, dict[str, object]] = {
    # element by element
    **{op: {} for op in ("Abs", "Neg", "Sqrt", "Reciprocal", "Exp", "Log", "Erf", "Floor", "Ceil", "Round", "Sign")},
    **{op: {} for op in ("Sigmoid", "Tanh", "Relu", "Softplus", "Softsign", "HardSwish", "Mish", "PRelu", "Clip")},
    **{op: {} for op in ("Add", "Sub", "Mul", "Div", "Pow", "Min", "Max", "Sum", "Mean")},
    **{op: {} for op in ("Where", "Equal", "Less", "Greater", "LessOrEqual", "GreaterOrEqual", "And", "Or", "Not")},
    **{op: {"alpha": _F} for op in ("LeakyRelu", "Elu", "Celu", "ThresholdedRelu")},
    "Selu": {"alpha": _F, "gamma": _F},
    "HardSigmoid": {"alpha": _F, "beta": _F},
    "Gelu": {"approximate": _S},
    "Cast": {"to": _I, "saturate": _I},
    # arrangement
    "Identity": {},
    "Constant": {"value": _T, "value_float": _F, "value_int": _I, "value_floats": _FS, "value_ints": _IS},
    "Concat": {"axis": _I},
    "Flatten": {"axis": _I},
    "Reshape": {"allowzero": _I},
    "Squeeze": {"axes": _IS},
    "Unsqueeze": {"axes": _IS},
    "Transpose": {"perm": _IS},
    "Slice": {},
    "Split": {"axis": _I, "split": _IS, "num_outputs": _I},
    "Gather": {"axis": _I},
    "Shape": {"start": _I, "end": _I},
    # layers
    "Conv": {"auto_pad": _S, "dilations": _IS, "group": _I, "kernel_shape": _IS, "pads": _IS, "strides": _IS},
    "Gemm": {"alpha": _F, "beta": _F, "transA": _I, "transB": _I},
    "MatMul": {},
    "MaxPool": {**_POOL, "storage_order": _I},
    "AveragePool": {**_POOL, "count_include_pad": _I},
    "GlobalAveragePool": {},
    "GlobalMaxPool": {},
    "BatchNormalization": {"epsilon": _F, "momentum": _F, "training_mode": _I},
    "InstanceNormalization": {"epsilon": _F},
    "LayerNormalization": {"axis": _I, "epsilon": _F, "stash_type": _I},
    "GroupNormalization": {"epsilon": _F, "num_groups": _I, "stash_type": _I},
    "Dropout": {"ratio": _F, "seed": _I},
    "Softmax": {"axis": _I},
    "LogSoftmax": {"axis": _I},
    **{op: _REDUCE for op in ("ReduceMean", "ReduceSum", "ReduceMax", "ReduceMin", "ReduceL2")},
}
FLOAT_ONLY = {"Div", "Pow", "Sqrt", "Reciprocal", "Exp", "Log"}  # whole numbers divide by zero with a crash
_MAX_PORTS = 64
_MAX_LIST = 64
_MAX_INTEGER = 1 << 31  # far beyond any size; larger ones would overflow the arithmetic of shapes


def check_operator(node: Node) -> None:
    """Raises UserFault ``onnx_operator``, ``onnx_attribute`` or ``onnx_graph``."""
    allowed = OPERATORS.get(node.op)
    if allowed is None:
        raise UserFault("onnx_operator", operator=printable(node.op, 40) or "?")
    for name, value in node.attributes.items():
        if name not in allowed or not _fits(value, allowed[name]) or _too_large(node.op, value):
            raise UserFault("onnx_attribute", operator=node.op, attribute=printable(name, 40))
    if not any(node.outputs) or max(len(node.inputs), len(node.outputs)) > _MAX_PORTS:
        raise UserFault("onnx_graph", problem=f"a {node.op} with too few or too many values")
    if node.op == "Cast" and node.attributes.get("to") not in DTYPES:
        raise UserFault("onnx_attribute", operator="Cast", attribute="to")
    if node.attributes.get("training_mode"):
        raise UserFault("onnx_attribute", operator=node.op, attribute="training_mode")


def _fits(value: Attribute, kind: object) -> bool:
    if kind in (_IS, _FS):
        wanted = int if kind == _IS else float
        return isinstance(value, list) and len(value) <= _MAX_LIST and all(isinstance(item, wanted) for item in value)
    return isinstance(value, kind)


def _too_large(op: str, value: Attribute) -> bool:
    """Whether a whole number is beyond use (exporters write the greatest one for "to the end" in Shape)."""
    numbers = value if isinstance(value, list) else [value]
    return op != "Shape" and any(isinstance(item, int) and abs(item) > _MAX_INTEGER for item in numbers)
