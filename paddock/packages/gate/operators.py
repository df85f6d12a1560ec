"""The operators that a model's network may use, with the permitted attributes of each."""

# Omitted on purpose: control flow (Loop, If, Scan), random operators, operators that compute the size of their output
# (Tile, Range, OneHot), strings, sequences, and recurrent layers (a policy has no memory between steps here).
#
# Permitted although they enlarge their input, because layers of torch become them and :mod:`.cost` counts the output:
# Resize (nn.Upsample, F.interpolate), Pad (F.pad, nn.ZeroPad2d), Expand and ConstantOfShape (broadcasting, F.normalize,
# the distributions of stable-baselines3), DepthToSpace and SpaceToDepth (nn.PixelShuffle). All of them compute the same
# on every processor, once their sizes are fixed.

import numpy as np

from paddock.errors import UserFault
from paddock.network.model import DTYPES, Attribute, Node
from paddock.network.wire import printable

Kind = type | str
_KINDS: dict[str, Kind] = {
    name: kind
    for kind, names in (
        (int, "to saturate value_int axis keepdims noop_with_empty_axes allowzero num_outputs start end blocksize"),
        (int, "antialias exclude_outside group transA transB ceil_mode storage_order count_include_pad training_mode"),
        (int, "stash_type num_groups seed"),
        (float, "alpha beta gamma value_float cubic_coeff_a extrapolation_value epsilon momentum ratio"),
        (str, "approximate mode auto_pad coordinate_transformation_mode keep_aspect_ratio_policy nearest_mode"),
        ("ints", "value_ints axes perm split dilations kernel_shape pads strides"),
        ("floats", "value_floats"),
        (np.ndarray, "value"),
    )
    for name in names.split()
}
_WINDOW = "auto_pad dilations kernel_shape pads strides"
# operators, with the names of the attributes that each may have
_ATTRIBUTES = {
    # element by element
    "Abs Neg Sqrt Reciprocal Exp Log Erf Floor Ceil Round Sign": "",
    "Sigmoid Tanh Relu Softplus Softsign HardSwish Mish PRelu Clip": "",
    "Add Sub Mul Div Pow Min Max Sum Mean": "",
    "Where Equal Less Greater LessOrEqual GreaterOrEqual And Or Not": "",
    "LeakyRelu Elu Celu ThresholdedRelu": "alpha",
    "Selu": "alpha gamma",
    "HardSigmoid": "alpha beta",
    "Gelu": "approximate",
    "Cast": "to saturate",
    # arrangement
    "Identity Slice Expand": "",
    "Constant": "value value_float value_int value_floats value_ints",
    "Concat Flatten Gather": "axis",
    "Reshape": "allowzero",
    "Squeeze Unsqueeze": "axes",
    "Transpose": "perm",
    "Split": "axis split num_outputs",
    "Shape": "start end",
    "ConstantOfShape": "value",
    "Pad": "mode",
    "DepthToSpace": "blocksize mode",
    "SpaceToDepth": "blocksize",
    "Resize": (
        "antialias axes coordinate_transformation_mode cubic_coeff_a exclude_outside extrapolation_value "
        "keep_aspect_ratio_policy mode nearest_mode"
    ),
    # layers
    "Conv": f"{_WINDOW} group",
    "Gemm": "alpha beta transA transB",
    "MatMul GlobalAveragePool GlobalMaxPool": "",
    "MaxPool": f"{_WINDOW} ceil_mode storage_order",
    "AveragePool": f"{_WINDOW} ceil_mode count_include_pad",
    "BatchNormalization": "epsilon momentum training_mode",
    "InstanceNormalization": "epsilon",
    "LayerNormalization": "axis epsilon stash_type",
    "GroupNormalization": "epsilon num_groups stash_type",
    "Dropout": "ratio seed",
    "Softmax LogSoftmax": "axis",
    "ReduceMean ReduceSum ReduceMax ReduceMin ReduceL1 ReduceL2": "axes keepdims noop_with_empty_axes",
    "ReduceSumSquare ReduceLogSum ReduceLogSumExp": "axes keepdims noop_with_empty_axes",
}
OPERATORS = {op: names.split() for ops, names in _ATTRIBUTES.items() for op in ops.split()}
FLOAT_ONLY = {"Div", "Pow", "Sqrt", "Reciprocal", "Exp", "Log"}  # whole numbers divide by zero with a crash
# the layers of torch that become an operator
_MEMORY, _LOOP = "a car has no memory between steps", "a loop or if in forward(); export by tracing, without them"
_SAMPLE = "a sample; export with deterministic=True, or the logits"
_QUANTISED = "a quantised network; export it in float32"
LAYERS = {
    **{op: f"nn.{op}: {_MEMORY}" for op in ("LSTM", "GRU", "RNN")},
    **dict.fromkeys(("RandomNormal", "RandomNormalLike", "RandomUniform", "RandomUniformLike"), _SAMPLE),
    **dict.fromkeys(("Multinomial", "Bernoulli"), _SAMPLE),
    **dict.fromkeys(("Loop", "If", "Scan"), _LOOP),
    "ArgMax": "torch.argmax inside of the network; return the logits",
    "OneHot": "F.one_hot",
    "Einsum": "torch.einsum; write it with torch.matmul",
    "ConvTranspose": "nn.ConvTranspose2d",
    "GridSample": "F.grid_sample",
    "NonMaxSuppression": "torchvision.ops.nms",
    "Tile": "Tensor.repeat; broadcasting needs none",
    "Range": "torch.arange of a size that is not fixed; export with fixed sizes",
    "ScatterND": "an assignment to a part of a tensor",
    **dict.fromkeys(("DynamicQuantizeLinear", "QuantizeLinear", "DequantizeLinear"), _QUANTISED),
}
_MAX_PORTS = 64
_MAX_LIST = 64
_MAX_INTEGER = 1 << 31  # far beyond any size; larger ones would overflow the arithmetic of shapes


def check_operator(node: Node) -> None:
    """Raises UserFault ``onnx_operator``, ``onnx_attribute`` or ``onnx_graph``."""
    allowed = OPERATORS.get(node.op)
    if allowed is None:
        layer, where = LAYERS.get(node.op, "see the list of operators"), printable(node.name, 80)
        raise UserFault("onnx_operator", operator=printable(node.op, 40) or "?", layer=layer, where=where)
    for name, value in node.attributes.items():
        if name not in allowed or not _fits(value, _KINDS[name]) or _too_large(node.op, value):
            raise _attribute(node, name)
    if not any(node.outputs) or max(len(node.inputs), len(node.outputs)) > _MAX_PORTS:
        raise UserFault("onnx_graph", problem=f"a {node.op} with too few or too many values")
    if node.op == "Cast" and node.attributes.get("to") not in DTYPES:
        raise _attribute(node, "to")
    for name in ("training_mode", "antialias"):
        if node.attributes.get(name):
            raise _attribute(node, name)


def _attribute(node: Node, name: str) -> UserFault:
    where = printable(node.name, 80) or "-"
    return UserFault("onnx_attribute", operator=node.op, attribute=printable(name, 40), where=where)


def _fits(value: Attribute, kind: Kind) -> bool:
    if isinstance(kind, str):
        wanted = int if kind == "ints" else float
        return isinstance(value, list) and len(value) <= _MAX_LIST and all(isinstance(item, wanted) for item in value)
    return isinstance(value, kind)


def _too_large(op: str, value: Attribute) -> bool:
    """Whether a whole number is beyond use (exporters write the greatest one for "to the end" in Shape)."""
    numbers = value if isinstance(value, list) else [value]
    return op != "Shape" and any(isinstance(item, int) and abs(item) > _MAX_INTEGER for item in numbers)
