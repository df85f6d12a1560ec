"""Every operator that a network may have is said in both formats as the runtime means it, or refused by name."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, compose, helper, numpy_helper

from paddock.errors import UserFault
from paddock.network.canonical import CanonicalNetwork
from paddock.packages.export.graphdef import policy_node, write_graph
from paddock.packages.export.ir import write_ir
from paddock.packages.export.lower import CONVERTERS, lower
from paddock.packages.export.plain import Plain
from paddock.packages.export.policy import Head, finish
from paddock.packages.gate.operators import OPERATORS
from paddock.packages.inputs import InputSpec
from tests.paddock.network.test_reference import CASES, OLDER, expected, network

from .test_export import openvino_core

HEAD = Head(is_sac=False, scores=False)
# What no plain operation is like: half precision, a picture with something else around it, windows with holes
REFUSED = [
    ("Cast", {"to": TensorProto.FLOAT16}),
    ("MaxPool", {"kernel_shape": [2, 2], "dilations": [2, 3]}),
    ("Resize", {"mode": "linear", "coordinate_transformation_mode": "tf_crop_and_resize", "extrapolation_value": 0.25}),
]
SIZES = {"Shape", "ConstantOfShape"}  # hang on no sensor: they are computed, and never written
# (a batch is one in every network, but not in every case of the reference)
WRITTEN = [
    (opset, case)
    for opset, cases in ((21, CASES), (11, OLDER))
    for case in cases
    if case[:2] not in REFUSED and case[0] not in SIZES and case[2][0].shape[0] == 1
]


def of_floats(case: tuple, opset: int, theirs: np.ndarray) -> onnx.ModelProto:
    """The case with floats as input and output, as every network has."""
    op, attributes, inputs = case
    model = network(op, attributes, inputs, opset)
    graph, reading = model.graph, inputs[0]
    nodes = list(graph.node)
    if reading.dtype != np.float32:
        kind = helper.np_dtype_to_tensor_dtype(reading.dtype)
        nodes = [helper.make_node("Cast", ["x"], ["read"], to=kind), *nodes]
        nodes[1].input[0] = "read"
    last = "y"
    if theirs.dtype != np.float32:
        last = "float"
        nodes.append(helper.make_node("Cast", ["y"], [last], to=TensorProto.FLOAT))
    port, output = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
        for name, shape in (("x", reading.shape), (last, theirs.shape))
    )
    new = helper.make_graph(nodes, "one", [port], [output], list(graph.initializer))
    return helper.make_model(new, opset_imports=[helper.make_opsetid("", opset)], ir_version=10)


def plain_of(model: onnx.ModelProto, readings: dict[str, np.ndarray]) -> Plain:
    shapes = {name: (*x.shape[2:], x.shape[1]) if x.ndim == 4 else x.shape[1:] for name, x in readings.items()}
    specs = {name: InputSpec(name, shape) for name, shape in shapes.items()}
    return finish(lower(CanonicalNetwork.read(model.SerializeToString()), specs), HEAD)


@cache
def together(opset: int) -> tuple[Plain, dict[str, np.ndarray], list[tuple[tuple, np.ndarray]]]:
    """One network of all cases, side by side; what its inputs read; the cases with what the runtime answers."""
    nodes, ports, stored, rows, readings, answers = [], [], [], [], {}, []
    for number, case in enumerate(case for version, case in WRITTEN if version == opset):
        theirs = expected(network(*case, opset), case[2][0])
        graph = compose.add_prefix(of_floats(case, opset, theirs), f"c{number}_").graph
        nodes += [*graph.node, helper.make_node("Reshape", [graph.output[0].name, "row"], [f"row{number}"])]
        ports += graph.input
        stored += graph.initializer
        rows.append(f"row{number}")
        readings[graph.input[0].name] = case[2][0].astype(np.float32)
        answers.append((case, theirs.astype(np.float64)))
    nodes.append(helper.make_node("Concat", rows, ["all"], axis=1))
    stored.append(numpy_helper.from_array(np.array([1, -1], np.int64), "row"))
    output = helper.make_tensor_value_info("all", TensorProto.FLOAT, (1, sum(theirs.size for _, theirs in answers)))
    graph = helper.make_graph(nodes, "all", ports, [output], stored)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=10)
    return plain_of(model, readings), readings, answers


@pytest.mark.parametrize("form", ["pb", "xml"])
@pytest.mark.parametrize("opset", [21, 11])
def test_openvino_means_every_operator_as_the_runtime_does(opset: int, form: str, tmp_path: Path) -> None:
    plain, readings, answers = together(opset)
    if form == "pb":
        graph = write_graph(plain, HEAD)
        (tmp_path / "car.pb").write_bytes(b"".join([*graph.parts, policy_node(graph, HEAD, b"")]))
    else:
        for ending, content in zip(("xml", "bin"), write_ir(plain, HEAD), strict=True):
            (tmp_path / f"car.{ending}").write_bytes(content)
    core = openvino_core()
    model = core.read_model(str(tmp_path / f"car.{form}"))
    feeds = {}
    for port in model.inputs:
        reading = readings[port.get_any_name().split(":")[0].rsplit("/", 1)[-1]]
        feeds[port] = reading.transpose(0, 2, 3, 1) if form == "pb" and reading.ndim == 4 else reading
    model.reshape({port: list(feed.shape) for port, feed in feeds.items()})
    settings = {"INFERENCE_PRECISION_HINT": "f32", "INFERENCE_NUM_THREADS": 1}
    (found,) = core.compile_model(model, "CPU", settings)(list(feeds.values())).values()
    wrong, at = [], 0
    for case, theirs in answers:
        ours = found[0, at : at + theirs.size].reshape(theirs.shape)
        at += theirs.size
        if not np.allclose(ours, theirs, rtol=0, atol=1e-5 * max(1.0, np.abs(theirs).max())):
            wrong.append((*case[:2], float(np.abs(ours - theirs).max())))
    assert at == found.size and not wrong


@pytest.mark.parametrize("refused", REFUSED)
def test_what_has_no_like_is_refused_by_name(refused: tuple) -> None:
    case = next(case for case in CASES if case[:2] == refused)
    theirs = expected(network(*case, 21), case[2][0])
    with pytest.raises(UserFault) as fault:
        plain_of(of_floats(case, 21, theirs), {"x": case[2][0]})
    assert fault.value.code == "export_operator"
    assert fault.value.params["operator"] == refused[0]


def test_every_allowed_operator_has_a_converter() -> None:
    never = {"Constant", "Dropout", *SIZES}  # the canonical form has none of the first two
    assert set(OPERATORS) - never <= set(CONVERTERS)
