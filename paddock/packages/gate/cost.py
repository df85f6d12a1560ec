"""Computes the cost of one step of a network from its shapes."""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from typing import Any

from paddock.errors import UserFault
from paddock.network import wire
from paddock.network.canonical import IR_VERSION, CanonicalNetwork
from paddock.network.model import DTYPES, FLOAT, FLOAT16, MAX_RANK, Node, Port
from paddock.network.written import NUMBERS, model_bytes
from paddock.packages.limits import PackageLimits

from .operators import FLOAT_ONLY

Shape = tuple[int, ...]
_SMALL = 64  # weights that shapes may hang on
# Field numbers of onnx/onnx.proto: of a ModelProto, of a GraphProto (inputs, outputs, others), of a ValueInfoProto
_GRAPH, _VALUES, _TENSOR = 7, (11, 12, 13), (2, 1)
_TAPS = {"nearest": 1, "linear": 4, "cubic": 16}  # values that one of a resized picture is made of


@dataclass(frozen=True)
class Cost:
    """``macs``: multiplications a step; ``elements``: intermediate values a step; ``output``: type and shape;
    ``shapes``: of all values and weights."""

    macs: int
    elements: int
    output: tuple[int, Shape]
    shapes: dict[str, Shape]


def _inference() -> Any:
    """onnx's compiled shape inference without the package around it, whose import takes as long as numpy's."""
    name = "onnx.onnx_cpp2py_export"
    if name not in sys.modules:
        package = find_spec("onnx")
        spec = package and PathFinder.find_spec(name, package.submodule_search_locations)
        if spec is None or spec.loader is None:
            raise ModuleNotFoundError(f"No module named {name!r}", name="onnx")
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        sys.modules[name] = module
    return sys.modules[name].shape_inference


INFERENCE = _inference()


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
    try:
        inferred = INFERENCE.infer_shapes(_light(network), True, True, True)  # check types, be strict, follow values
    except (INFERENCE.InferenceError, RuntimeError, ValueError) as error:
        raise UserFault("onnx_graph", problem="sizes or types of its operators do not fit") from error
    values = dict(_values(memoryview(inferred)))
    values |= {name: (NUMBERS[array.dtype.str[1:]], array.shape) for name, array in network.weights.items()}
    if any(name and name not in values for node in network.nodes for name in node.outputs):
        raise UserFault("onnx_dynamic")
    return values


def _light(network: CanonicalNetwork) -> bytes:
    """The network without its large weights, which are declared as inputs instead: enough for shape inference."""
    large = {name: array for name, array in network.weights.items() if array.size > _SMALL}
    declared = [Port(name, NUMBERS[array.dtype.str[1:]], list(array.shape)) for name, array in large.items()]
    small = {name: array for name, array in network.weights.items() if name not in large}
    output = Port(network.output.name, network.output.dtype, [None])  # nothing but its type is known yet
    return model_bytes(network.nodes, [*network.inputs, *declared], output, small, network.opset, IR_VERSION)


def _values(model: memoryview) -> Iterator[tuple[str, tuple[int, Shape]]]:
    """Name, element type and shape of each input, output and intermediate value of a ModelProto."""
    (graph,) = _at(model, _GRAPH)
    for number in _VALUES:
        for info in map(wire.message, _at(wire.message(graph), number)):
            (name,), shapes = _at(info, 1), _at(info, *_TENSOR, 2)
            dims = _at(info, *_TENSOR, 2, 1)
            if len(dims) > MAX_RANK:
                raise UserFault("onnx_graph", problem=f"a value of more than {MAX_RANK} dimensions")
            sizes = [_at(wire.message(dim), 1) for dim in dims]
            if not shapes or not all(sizes):
                raise UserFault("onnx_dynamic")
            dtype = wire.number(next(iter(_at(info, *_TENSOR, 1)), 0))
            if dtype not in DTYPES:
                raise UserFault("onnx_graph", problem="a value of unknown type")
            shape = tuple(wire.signed(wire.number(size)) for (size,) in sizes)
            if any(size < 0 for size in shape):
                raise UserFault("onnx_dynamic")
            yield wire.text(name), (dtype, shape)


def _at(data: memoryview, *path: int) -> list[int | memoryview]:
    """All values at a path of field numbers."""
    number, *inner = path
    found = [value for field, _, value in wire.fields(data, wire.Budget(len(data))) if field == number]
    return [value for one in found for value in _at(wire.message(one), *inner)] if inner else found


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
