"""What the static gate lets through, and that nothing of the uploaded file's form survives it."""

from __future__ import annotations

import copy
import json
import weakref

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from paddock.errors import UserFault
from paddock.network.model import FLOAT, Model, Port
from paddock.packages.gate import Canonical, check_onnx
from paddock.packages.gate.operators import OPERATORS
from paddock.packages.gate.outputs import select
from paddock.packages.limits import PackageLimits
from paddock.packages.metadata import parse_metadata
from tests.hostile.parts import CAMERA, metadata, network
from tests.soak import examples

from .coach import metadata_dict

META = parse_metadata(metadata())


def gate(model: onnx.ModelProto, data: bytes | None = None) -> Canonical:
    return check_onnx(model.SerializeToString(), parse_metadata(data or metadata()))


def answer(onnx_bytes: bytes, feed: dict[str, np.ndarray]) -> np.ndarray:
    return onnxruntime.InferenceSession(onnx_bytes, providers=["CPUExecutionProvider"]).run(None, feed)[0]


def picture(shape: tuple[int, ...] = (1, 120, 160, 1), dtype: type = np.uint8) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, shape).astype(dtype)


def planar_network() -> onnx.ModelProto:
    """A float NCHW network with convolutions, as torch exports one: with a free batch size."""
    random = np.random.default_rng(1)
    weights = {
        "net.0.weight": random.standard_normal((8, 1, 8, 8), np.float32) / 8,
        "net.0.bias": np.zeros(8, np.float32),
        "net.3.weight": random.standard_normal((5, 8), np.float32),
        "net.3.bias": np.zeros(5, np.float32),
        "scale": np.array(1 / 255, np.float32),
    }
    nodes = [
        helper.make_node("Mul", [CAMERA, "scale"], ["/Mul_output_0"], name="/Mul", doc_string="<script>"),
        helper.make_node("Conv", ["/Mul_output_0", "net.0.weight", "net.0.bias"], ["c"], strides=[4, 4]),
        helper.make_node("Relu", ["c"], ["r"]),
        helper.make_node("GlobalAveragePool", ["r"], ["g"]),
        helper.make_node("Flatten", ["g"], ["f"]),
        helper.make_node("Dropout", ["f"], ["d"]),
        helper.make_node("Identity", ["d"], ["i"]),
        helper.make_node("Gemm", ["i", "net.3.weight", "net.3.bias"], ["actions_out"], transB=1),
    ]
    graph = helper.make_graph(
        nodes,
        "torch_jit",
        [helper.make_tensor_value_info(CAMERA, TensorProto.FLOAT, ["batch", 1, 120, 160])],
        [helper.make_tensor_value_info("actions_out", TensorProto.FLOAT, ["batch", 5])],
        [numpy_helper.from_array(array, name) for name, array in weights.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def test_a_torch_export_passes_and_answers_the_same() -> None:
    model = planar_network()
    canonical = gate(model)
    assert canonical.inputs == ((CAMERA, "float32", (1, 1, 120, 160)),)
    assert canonical.output == ("actions", "float32", (1, 5))
    assert canonical.parameters == 8 * 64 + 8 + 5 * 8 + 5
    feed = {CAMERA: picture((1, 1, 120, 160), np.float32)}
    np.testing.assert_array_equal(answer(canonical.onnx, feed), answer(model.SerializeToString(), feed))


def test_the_canonical_form_is_a_fixed_point() -> None:
    canonical = gate(planar_network())
    assert check_onnx(canonical.onnx, META) == canonical


def dense_network(*, shared: bool = False, transposed: bool = False) -> onnx.ModelProto:
    """Mean brightness through two dense layers of 5 x 5, which may share their weights."""
    random = np.random.default_rng(5)
    weights = {name: random.standard_normal(shape, np.float32) for name, shape in (("a", (1, 5)), ("b", (5, 5)))}
    weights["c"] = random.standard_normal((5, 5), np.float32)
    if transposed:
        weights = {name: np.ascontiguousarray(array.T) for name, array in weights.items()}
    attributes = {"transB": 1} if transposed else {}
    nodes = [
        helper.make_node("GlobalAveragePool", [CAMERA], ["mean"]),
        helper.make_node("Flatten", ["mean"], ["flat"]),
        helper.make_node("Gemm", ["flat", "a"], ["one"], **attributes),
        helper.make_node("Gemm", ["one", "b"], ["two"], **attributes),
        helper.make_node("Gemm", ["two", "b" if shared else "c"], ["three"], **attributes),
    ]
    graph = helper.make_graph(
        nodes,
        "dense",
        [helper.make_tensor_value_info(CAMERA, TensorProto.FLOAT, [1, 1, 120, 160])],
        [helper.make_tensor_value_info("three", TensorProto.FLOAT, [1, 5])],
        [numpy_helper.from_array(array, name) for name, array in weights.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def test_transposed_dense_weights_make_the_same_model() -> None:
    plain, transposed = dense_network(), dense_network(transposed=True)
    canonical = gate(plain)
    assert canonical == gate(transposed)
    assert check_onnx(canonical.onnx, META) == canonical
    feed = {CAMERA: picture((1, 1, 120, 160), np.float32)}
    np.testing.assert_allclose(answer(canonical.onnx, feed), answer(plain.SerializeToString(), feed), rtol=1e-5)


def test_weights_shared_by_two_layers_do_not_change() -> None:
    model = dense_network(shared=True)
    canonical = gate(model)
    assert check_onnx(canonical.onnx, META) == canonical
    feed = {CAMERA: picture((1, 1, 120, 160), np.float32)}
    np.testing.assert_allclose(answer(canonical.onnx, feed), answer(model.SerializeToString(), feed), rtol=1e-5)


def test_the_canonical_form_is_valid_onnx() -> None:
    onnx.checker.check_model(onnx.load_from_string(gate(planar_network()).onnx), full_check=True)


def test_no_text_of_the_file_survives() -> None:
    model = planar_network()
    model.producer_name = model.doc_string = model.graph.name = model.graph.doc_string = "<script>alert(1)</script>"
    model.metadata_props.add(key="evil", value="x" * 100_000)
    model.graph.value_info.append(helper.make_tensor_value_info("c", TensorProto.FLOAT, None))
    model.graph.node[0].attribute.clear()
    for node in model.graph.node:
        node.name = "\x1b]0;owned\x07"
    canonical = gate(model)
    assert canonical.sha256 == gate(planar_network()).sha256
    for word in (b"script", b"owned", b"evil", b"torch", b"net.0"):
        assert word not in canonical.onnx


def test_names_order_and_storage_do_not_change_the_identity() -> None:
    plain, other = planar_network(), planar_network()
    del other.graph.initializer[:]
    for tensor in reversed(plain.graph.initializer):
        array = numpy_helper.to_array(tensor)
        stored = helper.make_tensor(tensor.name, TensorProto.FLOAT, array.shape, array.reshape(-1))  # float_data
        other.graph.initializer.append(stored)
        other.graph.input.append(helper.make_tensor_value_info(tensor.name, TensorProto.FLOAT, array.shape))
    other.graph.node.insert(0, helper.make_node("Constant", [], ["unused"], value_float=1.0))
    other.graph.node.append(helper.make_node("Relu", ["c"], ["nobody_reads_this"]))
    renamed = {"c": "zz", "r": "aa"}
    for node in other.graph.node:
        node.input[:] = [renamed.get(name, name) for name in node.input]
        node.output[:] = [renamed.get(name, name) for name in node.output]
    assert gate(other).onnx == gate(plain).onnx


def test_one_changed_weight_changes_the_identity() -> None:
    other = planar_network()
    array = numpy_helper.to_array(other.graph.initializer[3]).copy()
    array[0] = np.nextafter(np.float32(0), np.float32(1))
    other.graph.initializer[3].CopyFrom(numpy_helper.from_array(array, "net.3.bias"))
    assert gate(other).sha256 != gate(planar_network()).sha256


def test_a_continuous_car_answers_with_two_values() -> None:
    data = json.dumps(metadata_dict(head="continuous")).encode()
    model = network(
        [helper.make_node("Gemm", ["row", "two", "bias2"], ["scores"])],
        {"two": np.ones((1, 2), np.float32), "bias2": np.zeros(2, np.float32)},
        outputs=[helper.make_tensor_value_info("scores", TensorProto.FLOAT, [1, 2])],
    )
    assert gate(model, data).output == ("actions", "float32", (1, 2))


def test_several_sensors_are_ordered_by_name() -> None:
    data = metadata(sensor=["LIDAR", CAMERA])
    lidar = helper.make_tensor_value_info("LIDAR", TensorProto.FLOAT, [1, 64])
    camera = helper.make_tensor_value_info(CAMERA, TensorProto.UINT8, [1, 120, 160, 1])
    nodes = [
        helper.make_node("ReduceMax", ["LIDAR"], ["near"], axes=[1]),
        helper.make_node("Add", ["row", "near"], ["x"]),
    ]
    canonical = gate(network(nodes, inputs=[lidar, camera]), data)
    assert [name for name, _, _ in canonical.inputs] == [CAMERA, "LIDAR"]


def test_an_unused_sensor_stays_an_input() -> None:
    data = metadata(sensor=[CAMERA, "LIDAR"])
    camera = helper.make_tensor_value_info(CAMERA, TensorProto.UINT8, [1, 120, 160, 1])
    lidar = helper.make_tensor_value_info("LIDAR", TensorProto.FLOAT, [1, 64])
    canonical = gate(network(inputs=[camera, lidar]), data)
    feed = {CAMERA: picture(), "LIDAR": np.ones((1, 64), np.float32)}
    assert answer(canonical.onnx, feed).shape == (1, 5)


def test_an_output_read_again_keeps_its_meaning() -> None:
    nodes = [
        helper.make_node("Gemm", ["row", "dense", "bias"], ["first"]),
        helper.make_node("Add", ["first", "first"], ["twice"]),
        helper.make_node("Sub", ["twice", "first"], ["scores"]),
    ]
    model = network(nodes)
    feed = {CAMERA: picture()}
    np.testing.assert_array_equal(answer(gate(model).onnx, feed), answer(model.SerializeToString(), feed))


def test_unused_branches_cost_nothing() -> None:
    model = network()
    model.graph.node.append(helper.make_node("MatMul", ["dense_dead", "dense_dead"], ["dead"]))
    model.graph.initializer.append(numpy_helper.from_array(np.ones((1500, 1500), np.float32), "dense_dead"))
    assert gate(model).macs == gate(network()).macs
    assert len(gate(model).onnx) < 2000


@pytest.mark.parametrize("opset", [11, 13, 15, 17])
def test_recent_operator_sets_pass(opset: int) -> None:
    model = network(opset=opset)
    if opset < 13:  # Unsqueeze had its axes as an attribute
        del model.graph.node[2].input[1]
        model.graph.node[2].attribute.append(helper.make_attribute("axes", [1]))
    feed = {CAMERA: picture()}
    np.testing.assert_array_equal(answer(gate(model).onnx, feed), answer(model.SerializeToString(), feed))


def test_every_allowed_operator_exists_in_onnx() -> None:
    known = {schema.name for schema in onnx.defs.get_all_schemas_with_history() if schema.domain == ""}
    assert set(OPERATORS) <= known


def test_no_allowed_attribute_holds_a_graph() -> None:
    graph_kinds = {onnx.defs.OpSchema.AttrType.GRAPH, onnx.defs.OpSchema.AttrType.GRAPHS}
    for op in OPERATORS:
        kinds = {attribute.type for attribute in onnx.defs.get_schema(op).attributes.values()}
        assert not kinds & graph_kinds


def test_a_smaller_budget_refuses_what_a_larger_one_admits() -> None:
    data = planar_network().SerializeToString()
    macs = gate(planar_network()).macs
    assert check_onnx(data, META, PackageLimits(macs=macs)).macs == macs
    with pytest.raises(UserFault) as fault:
        check_onnx(data, META, PackageLimits(macs=macs - 1))
    assert fault.value.code == "network_too_slow"


GOOD = planar_network().SerializeToString()


@settings(max_examples=examples(400), deadline=None)
@given(st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), min_size=1, max_size=3))
def test_any_damage_gives_a_reason_or_a_sound_network(damage: list[tuple[int, int]]) -> None:
    broken = bytearray(GOOD)
    for at, byte in damage:
        broken[at] = byte
    try:
        canonical = check_onnx(bytes(broken), META)
    except UserFault as fault:
        assert str(fault).isprintable()
        return
    assert check_onnx(canonical.onnx, META) == canonical


@pytest.mark.parametrize("op", ["Constant", "Identity", "Dropout", "Relu"])
def test_an_operator_without_a_result_is_refused(op: str) -> None:
    model = planar_network()
    model.graph.node.append(helper.make_node(op, [] if op == "Constant" else ["i"], []))
    with pytest.raises(UserFault) as fault:
        gate(model)
    assert fault.value.code == "onnx_graph" and f"a {op} without a result" in str(fault.value)


def test_values_of_many_dimensions_are_refused_before_their_sizes_are_read() -> None:
    model = planar_network()
    axes = numpy_helper.from_array(np.arange(12, dtype=np.int64), "axes")
    model.graph.initializer.append(axes)
    model.graph.node.insert(-1, helper.make_node("Unsqueeze", ["i", "axes"], ["wide"]))
    model.graph.node.insert(-1, helper.make_node("Squeeze", ["wide", "axes"], ["narrow"]))
    model.graph.node[-1].input[0] = "narrow"
    with pytest.raises(UserFault) as fault:
        gate(model)
    assert fault.value.code == "onnx_graph" and "more than 8 dimensions" in str(fault.value)


@settings(max_examples=examples(200), deadline=None)
@given(st.integers(0, len(GOOD) - 1))
def test_a_truncated_network_is_refused(length: int) -> None:
    with pytest.raises(UserFault):
        check_onnx(GOOD[:length], META)


def test_the_gate_does_not_modify_its_input() -> None:
    model = planar_network()
    before = copy.deepcopy(model)
    gate(model)
    assert model == before


def test_only_the_first_refused_output_keeps_its_network() -> None:
    """A fault keeps the network of its output in memory, which may be hundreds of megabytes."""
    networks: list[weakref.ref] = []
    held: list[int] = []

    def check(port: Port) -> None:
        held.append(sum(one() is not None for one in networks))
        network = np.zeros(1)
        networks.append(weakref.ref(network))
        raise UserFault("onnx_output", expected=5, found=port.name)

    outputs = [Port(name, FLOAT, [1, None]) for name in "abcd"]
    with pytest.raises(UserFault) as refused:
        select(Model(outputs=outputs), META, check)
    assert refused.value.params["found"] == "a" and held == [0, 1, 1, 1]
