"""The operators a model's network may use, with the attributes each may have.

Left out on purpose: control flow (Loop, If, Scan), anything random, operators that make their output's size out of
numbers (Tile, Range, OneHot), strings, sequences, and recurrent layers (a policy has no memory between steps here).
Reasons: platforms.md B.5 and B.6.

Let in although they make much out of little, because layers of torch become them and :mod:`.cost` counts what comes
out: Resize (nn.Upsample, F.interpolate), Pad (F.pad, nn.ZeroPad2d), Expand and ConstantOfShape (broadcasting,
F.normalize, the distributions of stable-baselines3), DepthToSpace and SpaceToDepth (nn.PixelShuffle). All of them
compute the same on every processor, once their sizes are fixed.
"""

from __future__ import annotations

import numpy as np

from paddock.errors import UserFault
from paddock.network.model import DTYPES, Attribute, Node
from paddock.network.wire import printable

Kind = type | str
_I, _F, _S, _IS, _FS, _T = int, float, str, "ints", "floats", np.ndarray
_POOL: dict[str, Kind] = {
    "auto_pad": _S,
    "ceil_mode": _I,
    "dilations": _IS,
    "kernel_shape": _IS,
    "pads": _IS,
    "strides": _IS,
}
_REDUCE: dict[str, Kind] = {"axes": _IS, "keepdims": _I, "noop_with_empty_axes": _I}

OPERATORS: dict[str, dict[str, Kind]] = {
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
    "Expand": {},
    "ConstantOfShape": {"value": _T},
    "Pad": {"mode": _S},
    "DepthToSpace": {"blocksize": _I, "mode": _S},
    "SpaceToDepth": {"blocksize": _I},
    "Resize": {
        "antialias": _I,
        "axes": _IS,
        "coordinate_transformation_mode": _S,
        "cubic_coeff_a": _F,
        "exclude_outside": _I,
        "extrapolation_value": _F,
        "keep_aspect_ratio_policy": _S,
        "mode": _S,
        "nearest_mode": _S,
    },
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
    **{op: _REDUCE for op in ("ReduceMean", "ReduceSum", "ReduceMax", "ReduceMin", "ReduceL1", "ReduceL2")},
    **{op: _REDUCE for op in ("ReduceSumSquare", "ReduceLogSum", "ReduceLogSumExp")},
}
FLOAT_ONLY = {"Div", "Pow", "Sqrt", "Reciprocal", "Exp", "Log"}  # whole numbers divide by zero with a crash
# what a user of torch knows such an operator by
LAYERS = {
    "LSTM": "nn.LSTM: a car has no memory between steps",
    "GRU": "nn.GRU: a car has no memory between steps",
    "RNN": "nn.RNN: a car has no memory between steps",
    **{
        op: "a sample; export with deterministic=True, or the logits"
        for op in ("RandomNormal", "RandomNormalLike", "RandomUniform", "RandomUniformLike", "Multinomial", "Bernoulli")
    },
    **{op: "a loop or if in forward(); export by tracing, without them" for op in ("Loop", "If", "Scan")},
    "ArgMax": "torch.argmax inside of the network; return the logits",
    "OneHot": "F.one_hot",
    "Einsum": "torch.einsum; write it with torch.matmul",
    "ConvTranspose": "nn.ConvTranspose2d",
    "GridSample": "F.grid_sample",
    "NonMaxSuppression": "torchvision.ops.nms",
    "Tile": "Tensor.repeat; broadcasting needs none",
    "Range": "torch.arange of a size that is not fixed; export with fixed sizes",
    "ScatterND": "an assignment to a part of a tensor",
    "DynamicQuantizeLinear": "a quantised network; export it in float32",
    "QuantizeLinear": "a quantised network; export it in float32",
    "DequantizeLinear": "a quantised network; export it in float32",
}
_MAX_PORTS = 64
_MAX_LIST = 64
_MAX_INTEGER = 1 << 31  # far beyond any size; larger ones would overflow the arithmetic of shapes


def check_operator(node: Node) -> None:
    """Raises UserFault ``onnx_operator``, ``onnx_attribute`` or ``onnx_graph``."""
    allowed = OPERATORS.get(node.op)
    if allowed is None:
        raise UserFault(
            "onnx_operator", operator=printable(node.op, 40) or "?", layer=_layer(node), where=printable(node.name, 80)
        )
    for name, value in node.attributes.items():
        if name not in allowed or not _fits(value, allowed[name]) or _too_large(node.op, value):
            raise _attribute(node, name)
    if not any(node.outputs) or max(len(node.inputs), len(node.outputs)) > _MAX_PORTS:
        raise UserFault("onnx_graph", problem=f"a {node.op} with too few or too many values")
    if node.op == "Cast" and node.attributes.get("to") not in DTYPES:
        raise _attribute(node, "to")
    if node.attributes.get("training_mode"):
        raise _attribute(node, "training_mode")
    if node.attributes.get("antialias"):
        raise _attribute(node, "antialias")


def _attribute(node: Node, name: str) -> UserFault:
    return UserFault(
        "onnx_attribute", operator=node.op, attribute=printable(name, 40), where=printable(node.name, 80) or "-"
    )


def _layer(node: Node) -> str:
    """What a user of torch wrote, as far as that is known."""
    return LAYERS.get(node.op, "see the list of operators")


def _fits(value: Attribute, kind: Kind) -> bool:
    if isinstance(kind, str):
        wanted = int if kind == _IS else float
        return isinstance(value, list) and len(value) <= _MAX_LIST and all(isinstance(item, wanted) for item in value)
    return isinstance(value, kind)


def _too_large(op: str, value: Attribute) -> bool:
    """Whether a whole number is beyond use (exporters write the greatest one for "to the end" in Shape)."""
    numbers = value if isinstance(value, list) else [value]
    return op != "Shape" and any(isinstance(item, int) and abs(item) > _MAX_INTEGER for item in numbers)
