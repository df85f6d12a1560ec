"""Computes the cost of one step of a network from its shapes."""

import math
from dataclasses import dataclass

import onnx
from onnx import shape_inference

from paddock.errors import UserFault
from paddock.network.canonical import IR_VERSION, CanonicalNetwork
from paddock.network.model import DTYPES, FLOAT, FLOAT16, Node, Port
from paddock.network.written import NUMBERS, model_bytes
from paddock.packages.limits import PackageLimits

from .operators import FLOAT_ONLY

Shape = tuple[int, ...]
_SMALL = 64  # weights that shapes may hang on
_TAPS = {"nearest": 1, "linear": 4, "cubic": 16}  # values that one of a resized picture is made of


@dataclass(frozen=True)
class Cost:
    """``macs``: multiplications a step; ``elements``: intermediate values a step; ``output``: type and shape;
    ``shapes``: of all values and weights."""

    macs: int
    elements: int
    output: tuple[int, Shape]
    shapes: dict[str, Shape]


def measure(network: CanonicalNetwork, limits: PackageLimits) -> Cost:
    """Infer every shape and count. All shapes must be fixed.

    Raises UserFault ``onnx_graph``, ``onnx_dynamic``, ``network_too_slow`` or ``network_too_wide``.
    """
    values = _infer(network)
    macs = elements = 0
    for node in network.nodes:
        _check_types(node, values)
        macs += _macs(node, values)
        elements += sum(math.prod(values[name][1]) for name in node.outputs if name)
        elements += sum(math.prod(values[name][1]) for name in node.inputs if name and name not in network.weights)
        if macs > limits.macs:
            raise UserFault(
                "network_too_slow", macs_million=round(macs / 1e6), limit_million=round(limits.macs / 1e6)
            )  # fmt: skip
        if elements > limits.elements:
            raise UserFault("network_too_wide")
    shapes = {name: shape for name, (_, shape) in values.items()}
    return Cost(macs, elements, values[network.output.name], shapes)


def _infer(network: CanonicalNetwork) -> dict[str, tuple[int, Shape]]:
    """The element type and shape of every value, by ONNX's own rules."""
    light = _light(network)
    light.graph.output[0].type.tensor_type.ClearField("shape")
    try:
        inferred = shape_inference.infer_shapes(light, check_type=True, strict_mode=True, data_prop=True)
    except (shape_inference.InferenceError, RuntimeError, ValueError) as error:
        raise UserFault("onnx_graph", problem="sizes or types of its operators do not fit") from error
    graph = inferred.graph
    values: dict[str, tuple[int, Shape]] = {}
    for info in (*graph.value_info, *graph.input, *graph.output):
        values[info.name] = _static(info)
    for tensor in graph.initializer:
        values[tensor.name] = (tensor.data_type, tuple(tensor.dims))
    if any(name and name not in values for node in network.nodes for name in node.outputs):
        raise UserFault("onnx_dynamic")
    return values


def _light(network: CanonicalNetwork) -> onnx.ModelProto:
    """The network without its large weights, which are declared as inputs instead: enough for shape inference."""
    large = {name: array for name, array in network.weights.items() if array.size > _SMALL}
    declared = [Port(name, NUMBERS[array.dtype.str[1:]], list(array.shape)) for name, array in large.items()]
    small = {name: array for name, array in network.weights.items() if name not in large}
    # (of the output nothing but its type is known yet, and its shape is left out again)
    output = Port(network.output.name, network.output.dtype, [])
    written = model_bytes(network.nodes, [*network.inputs, *declared], output, small, network.opset, IR_VERSION)
    return onnx.load_from_string(written)


def _static(info: onnx.ValueInfoProto) -> tuple[int, Shape]:
    kind = info.type.tensor_type
    if not kind.HasField("shape") or not all(dim.HasField("dim_value") for dim in kind.shape.dim):
        raise UserFault("onnx_dynamic")
    if kind.elem_type not in DTYPES:
        raise UserFault("onnx_graph", problem="a value of unknown type")
    shape = tuple(dim.dim_value for dim in kind.shape.dim)
    if any(size < 0 for size in shape):
        raise UserFault("onnx_dynamic")
    return kind.elem_type, shape


def _check_types(node: Node, values: dict[str, tuple[int, Shape]]) -> None:
    if node.op in FLOAT_ONLY and any(values[name][0] not in (FLOAT, FLOAT16) for name in node.inputs if name):
        raise UserFault("onnx_graph", problem=f"a {node.op} of whole numbers")


def _macs(node: Node, values: dict[str, tuple[int, Shape]]) -> int:
    """Multiplications of one node; operations of another kind count their outputs only (in ``elements``)."""
    out = math.prod(values[node.outputs[0]][1]) if node.outputs[0] else 0
    shapes = [values[name][1] if name else () for name in node.inputs]
    if node.op == "Conv":
        return out * math.prod(shapes[1][1:])
    if node.op == "MatMul":
        return out * (shapes[0][-1] if shapes[0] else 1)
    if node.op == "Gemm":
        return out * shapes[0][0 if node.whole("transA", 0) else 1]
    if node.op == "Resize":
        return out * _TAPS.get(node.text("mode", "nearest"), 16)
    if node.op in ("MaxPool", "AveragePool"):
        return out * math.prod(node.wholes("kernel_shape") or [1])
    return 0
