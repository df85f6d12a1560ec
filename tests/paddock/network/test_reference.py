"""The float64 evaluator computes what the runtime computes, for every operator that a network may have."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from paddock.network.canonical import CanonicalNetwork
from paddock.network.reference import Reference
from paddock.packages.gate.operators import OPERATORS

RANDOM = np.random.default_rng(5)


def drawn(*shape, low=-2.0, high=2.0):
    return RANDOM.uniform(low, high, shape).astype(np.float32)


ROW, POSITIVE = drawn(1, 12), drawn(1, 12, low=0.1, high=3.0)
PICTURE = drawn(1, 4, 9, 11)
WHOLE = RANDOM.integers(-9, 9, (1, 12))


def whole(*values, dtype=np.int64):
    return np.array(values, dtype)


KERNEL, GROUPED = drawn(6, 4, 3, 3), drawn(8, 2, 3, 2)
POOL = {"kernel_shape": [3, 2], "strides": [2, 2]}
NONE = None  # an optional input that is left out

# operator, attributes, inputs; the first is what a sensor gives, the others are weights
CASES = [
    *((op, {}, [ROW]) for op in ("Abs", "Neg", "Exp", "Erf", "Floor", "Ceil", "Round", "Sign", "Sigmoid", "Tanh")),
    *((op, {}, [ROW]) for op in ("Relu", "Softplus", "Softsign", "HardSwish", "Mish")),
    *((op, {}, [POSITIVE]) for op in ("Sqrt", "Reciprocal", "Log")),
    ("Round", {}, [np.array([[0.5, 1.5, 2.5, -0.5, -1.5, 3.2]], np.float32)]),
    ("Sigmoid", {}, [np.array([[-200.0, 200.0, 0.0]], np.float32)]),
    ("Softplus", {}, [np.array([[-200.0, 80.0, 0.0]], np.float32)]),
    ("PRelu", {}, [PICTURE, drawn(4, 1, 1)]),
    ("Clip", {}, [ROW, np.array(-0.5, np.float32), np.array(0.7, np.float32)]),
    ("Clip", {}, [ROW, NONE, np.array(0.7, np.float32)]),
    ("Clip", {}, [ROW]),
    *((op, {}, [ROW, drawn(1, 12)]) for op in ("Add", "Sub", "Mul", "Div")),
    *((op, {}, [PICTURE, drawn(11)]) for op in ("Add", "Sub", "Mul", "Div")),
    ("Pow", {}, [POSITIVE, drawn(1, 12)]),
    ("Pow", {}, [ROW, whole(2)]),
    *((op, {}, [ROW, drawn(1, 12), drawn(1, 1)]) for op in ("Min", "Max", "Sum", "Mean")),
    ("Where", {}, [RANDOM.integers(0, 2, (1, 12)).astype(bool), drawn(1, 12), drawn(1, 12)]),
    *((op, {}, [ROW, drawn(1, 12)]) for op in ("Less", "Greater", "LessOrEqual", "GreaterOrEqual")),
    ("Equal", {}, [WHOLE, np.where(WHOLE > 0, WHOLE, 3)]),
    *((op, {}, [WHOLE > 0, WHOLE % 2 == 0]) for op in ("And", "Or")),
    ("Not", {}, [WHOLE > 0]),
    *((op, {}, [ROW]) for op in ("LeakyRelu", "Elu", "Celu", "ThresholdedRelu", "Selu", "HardSigmoid", "Gelu")),
    *((op, {"alpha": 0.3}, [ROW]) for op in ("LeakyRelu", "Elu", "Celu", "ThresholdedRelu")),
    ("Selu", {"alpha": 1.2, "gamma": 0.9}, [ROW]),
    ("HardSigmoid", {"alpha": 0.4, "beta": 0.3}, [ROW]),
    ("Gelu", {"approximate": "tanh"}, [ROW]),
    ("Cast", {"to": TensorProto.INT32}, [ROW]),
    ("Cast", {"to": TensorProto.FLOAT}, [RANDOM.integers(0, 255, (1, 12)).astype(np.uint8)]),
    ("Cast", {"to": TensorProto.BOOL}, [ROW]),
    ("Cast", {"to": TensorProto.FLOAT16}, [ROW]),
    ("Cast", {"to": TensorProto.INT64}, [WHOLE.astype(np.int32)]),
    ("Identity", {}, [ROW]),
    ("Concat", {"axis": 1}, [PICTURE, drawn(1, 2, 9, 11)]),
    ("Concat", {"axis": -1}, [PICTURE, drawn(1, 4, 9, 1)]),
    ("Flatten", {}, [PICTURE]),
    ("Flatten", {"axis": -1}, [PICTURE]),
    ("Flatten", {"axis": 0}, [PICTURE]),
    ("Reshape", {}, [PICTURE, whole(0, -1, 9)]),
    ("Reshape", {"allowzero": 1}, [PICTURE, whole(1, 36, 11)]),
    ("Squeeze", {}, [PICTURE, whole(0)]),
    ("Squeeze", {}, [drawn(1, 3, 1)]),
    ("Unsqueeze", {}, [ROW, whole(0, -1)]),
    ("Transpose", {"perm": [0, 2, 3, 1]}, [PICTURE]),
    ("Transpose", {}, [PICTURE]),
    ("Slice", {}, [PICTURE, whole(1, 2), whole(4, 99), whole(1, 3)]),
    ("Slice", {}, [PICTURE, whole(-1), whole(-99), whole(2), whole(-2)]),
    ("Slice", {}, [PICTURE, whole(0, 1), whole(1, -1)]),
    ("Split", {"axis": 1}, [ROW, whole(5, 7)]),
    ("Split", {"axis": 1, "num_outputs": 2}, [ROW]),
    ("Gather", {"axis": 1}, [PICTURE, whole(3, -1, 0)]),
    ("Gather", {}, [PICTURE, whole(0)]),
    ("Shape", {}, [PICTURE]),
    ("Shape", {"start": 1, "end": -1}, [PICTURE]),
    ("Expand", {}, [ROW, whole(3, 1)]),
    ("ConstantOfShape", {"value": np.array([2.5], np.float32)}, [whole(1, 3)]),
    ("Pad", {}, [PICTURE, whole(0, 0, 1, 2, 0, 1, 0, 3), np.array(0.4, np.float32)]),
    ("Pad", {"mode": "reflect"}, [PICTURE, whole(2, 1, 1, 3), NONE, whole(2, 3)]),
    ("Pad", {"mode": "edge"}, [PICTURE, whole(0, 0, 2, 0, 0, 0, 0, 1)]),
    ("Pad", {"mode": "wrap"}, [PICTURE, whole(0, 0, 2, 0, 0, 0, 0, 1)]),
    ("Pad", {}, [PICTURE, whole(0, 0, -1, 0, 0, 0, 0, -2)]),
    ("DepthToSpace", {"blocksize": 2}, [PICTURE]),
    ("DepthToSpace", {"blocksize": 2, "mode": "CRD"}, [PICTURE]),
    ("SpaceToDepth", {"blocksize": 3}, [drawn(1, 2, 9, 6)]),
    ("Conv", {}, [PICTURE, KERNEL]),
    ("Conv", {"strides": [2, 1], "pads": [1, 0, 2, 1]}, [PICTURE, KERNEL, drawn(6)]),
    ("Conv", {"group": 2, "dilations": [2, 1]}, [PICTURE, GROUPED, drawn(8)]),
    ("Conv", {"auto_pad": "SAME_UPPER", "strides": [2, 2]}, [PICTURE, KERNEL]),
    ("Conv", {"auto_pad": "SAME_LOWER", "strides": [2, 3]}, [PICTURE, KERNEL]),
    ("Conv", {"auto_pad": "VALID"}, [PICTURE, KERNEL]),
    ("Conv", {}, [drawn(1, 2, 20), drawn(3, 2, 5)]),
    ("Gemm", {}, [ROW, drawn(12, 5)]),
    ("Gemm", {"transB": 1, "alpha": 0.5, "beta": 2.0}, [ROW, drawn(5, 12), drawn(5)]),
    ("Gemm", {"transA": 1}, [drawn(12, 3), drawn(12, 5), drawn(3, 1)]),
    ("Gemm", {"transB": 1}, [drawn(1, 2000), drawn(150, 2000), drawn(150)]),
    ("Gemm", {}, [drawn(1, 2000), drawn(2000, 150)]),
    ("MatMul", {}, [ROW, drawn(12, 5)]),
    ("MatMul", {}, [PICTURE, drawn(11, 3)]),
    ("MatMul", {}, [drawn(300, 700), drawn(700, 40)]),
    ("MaxPool", POOL, [PICTURE]),
    ("MaxPool", {**POOL, "pads": [1, 0, 1, 1], "ceil_mode": 1}, [PICTURE]),
    ("MaxPool", {"kernel_shape": [2, 2], "dilations": [2, 3]}, [PICTURE]),
    ("MaxPool", {**POOL, "auto_pad": "SAME_UPPER"}, [PICTURE]),
    ("AveragePool", POOL, [PICTURE]),
    ("AveragePool", {**POOL, "pads": [1, 0, 1, 1]}, [PICTURE]),
    ("AveragePool", {**POOL, "pads": [1, 0, 1, 1], "count_include_pad": 1}, [PICTURE]),
    ("AveragePool", {**POOL, "pads": [1, 0, 1, 1], "ceil_mode": 1}, [PICTURE]),
    ("AveragePool", {**POOL, "auto_pad": "SAME_LOWER"}, [PICTURE]),
    ("GlobalAveragePool", {}, [PICTURE]),
    ("GlobalMaxPool", {}, [PICTURE]),
    ("BatchNormalization", {"epsilon": 1e-3}, [PICTURE, drawn(4), drawn(4), drawn(4), drawn(4, low=0.1)]),
    ("InstanceNormalization", {}, [PICTURE, drawn(4), drawn(4)]),
    ("LayerNormalization", {}, [PICTURE, drawn(11), drawn(11)]),
    ("LayerNormalization", {"axis": 1, "epsilon": 1e-3}, [PICTURE, drawn(4, 9, 11)]),
    ("GroupNormalization", {"num_groups": 2}, [PICTURE, drawn(4), drawn(4)]),
    ("Softmax", {}, [ROW]),
    ("Softmax", {"axis": 1}, [PICTURE]),
    ("LogSoftmax", {}, [ROW]),
    *((f"Reduce{op}", {}, [POSITIVE]) for op in ("LogSum", "LogSumExp")),
    *((f"Reduce{op}", {}, [PICTURE, whole(1, -1)]) for op in ("Mean", "Sum", "Max", "Min", "L1", "L2")),
    *((f"Reduce{op}", {"keepdims": 0}, [PICTURE, whole(2)]) for op in ("Mean", "SumSquare", "LogSumExp", "Max")),
    ("ReduceSum", {"noop_with_empty_axes": 1}, [PICTURE]),
    *(
        ("Resize", {"mode": mode, "coordinate_transformation_mode": where}, [PICTURE, NONE, NONE, whole(1, 4, 14, 7)])
        for mode in ("nearest", "linear", "cubic")
        for where in ("half_pixel", "pytorch_half_pixel", "align_corners", "asymmetric")
    ),
    *(
        (
            "Resize",
            {"mode": "nearest", "nearest_mode": how, "coordinate_transformation_mode": "asymmetric"},
            [PICTURE, NONE, np.array([1, 1, 2, 1.5], np.float32)],
        )
        for how in ("floor", "ceil", "round_prefer_floor", "round_prefer_ceil")
    ),
    ("Resize", {"mode": "linear", "axes": [2, 3]}, [PICTURE, NONE, np.array([0.6, 1.7], np.float32)]),
    (
        "Resize",
        {"mode": "cubic", "cubic_coeff_a": -0.5, "exclude_outside": 1},
        [PICTURE, NONE, np.array([1, 1, 1.4, 2], np.float32)],
    ),
    (
        "Resize",
        {"mode": "linear", "axes": [2, 3], "keep_aspect_ratio_policy": "not_larger"},
        [PICTURE, NONE, NONE, whole(20, 12)],
    ),
    (
        "Resize",
        {"mode": "linear", "coordinate_transformation_mode": "tf_crop_and_resize", "extrapolation_value": 0.25},
        [PICTURE, np.array([0, 0, 0.1, -0.2, 1, 1, 0.8, 0.9], np.float32), NONE, whole(1, 4, 6, 8)],
    ),
]
OLDER = [  # as version 11 of the standard has them
    ("Softmax", {}, [PICTURE]),
    ("LogSoftmax", {"axis": 2}, [PICTURE]),
    ("Squeeze", {"axes": [0]}, [PICTURE]),
    ("Unsqueeze", {"axes": [0, 3]}, [ROW]),
    ("Split", {"axis": 1, "split": [5, 7]}, [ROW]),
    ("Split", {"axis": 1}, [ROW]),
    ("ReduceMean", {"axes": [1, 2], "keepdims": 0}, [PICTURE]),
    ("ReduceSum", {"axes": [3]}, [PICTURE]),
    ("Clip", {}, [ROW, NONE, np.array(0.5, np.float32)]),
]
NEVER = {"Constant", "Dropout"}  # the canonical form has none


def network(op, attributes, inputs, opset):
    """One operator over a reading; only its first output is looked at."""
    reading, *weights = inputs
    names = ["x", *("" if array is None else f"w{number}" for number, array in enumerate(weights))]
    stored = [
        numpy_helper.from_array(array, name)
        for name, array in zip(names[1:], weights, strict=True)
        if array is not None
    ]
    said = {
        name: numpy_helper.from_array(value) if isinstance(value, np.ndarray) else value
        for name, value in attributes.items()
    }
    outputs = ["y", "rest"] if op == "Split" else ["y"]
    node = helper.make_node(op, names, outputs, **said)
    port = helper.make_tensor_value_info("x", helper.np_dtype_to_tensor_dtype(reading.dtype), reading.shape)
    graph = helper.make_graph([node], "one", [port], [helper.make_empty_tensor_value_info("y")], stored)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=10)


def expected(model, reading):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(["y"], {"x": reading})[0]


def found(model, reading, dtype):
    """The evaluator's answer, of a file whose output says its type and size."""
    output = helper.make_tensor_value_info("y", helper.np_dtype_to_tensor_dtype(dtype), [1])
    model.graph.output[0].CopyFrom(output)
    return Reference(CanonicalNetwork.read(model.SerializeToString())).run({"x": reading})


@pytest.mark.parametrize("opset, case", [*((21, case) for case in CASES), *((11, case) for case in OLDER)])
def test_every_operator_agrees_with_the_runtime(opset, case):
    op, attributes, inputs = case
    model = network(op, attributes, inputs, opset)
    theirs = expected(model, inputs[0])
    ours = found(model, inputs[0], theirs.dtype)
    assert ours.dtype == np.float64 and ours.shape == theirs.shape
    largest = max(1.0, np.abs(theirs.astype(np.float64)).max())
    np.testing.assert_allclose(ours, theirs.astype(np.float64), rtol=2e-5, atol=5e-6 * largest)


def test_every_allowed_operator_has_a_case():
    assert set(OPERATORS) - NEVER == {op for op, *_ in CASES}


def test_it_computes_in_float64():
    one = np.array([[1.0, 3.0]], np.float32)
    third = found(network("Div", {}, [one, one[:, ::-1].copy()], 21), one, one.dtype)
    assert third.tolist() == [[1 / 3, 3.0]]
    assert float(np.float32(1 / 3)) != 1 / 3


def test_a_number_too_large_for_an_integer_saturates():
    far = np.array([[1e30, -1e30, np.nan, 7.9]], np.float32)
    for to, low, high in ((TensorProto.INT32, -(2**31), 2**31 - 1), (TensorProto.UINT8, 0, 255)):
        assert found(network("Cast", {"to": to}, [far], 21), far, np.dtype(np.int32)).tolist() == [[high, low, 0, 7]]


def test_answers_are_bit_identical_with_or_without_kept_weights():
    reading = drawn(1, 3000)
    model = network("Gemm", {"transB": 1}, [reading, drawn(200, 3000), drawn(200)], 21)
    model.graph.output[0].CopyFrom(helper.make_tensor_value_info("y", TensorProto.FLOAT, [1]))
    reference = Reference(CanonicalNetwork.read(model.SerializeToString()))
    answers = [reference.run({"x": reading}) for _ in range(4)]
    np.testing.assert_allclose(answers[0], answers[3], rtol=1e-12)
    assert answers[2].tobytes() == answers[3].tobytes()


@pytest.mark.parametrize(
    "op, attributes, inputs, is_step",
    [
        ("Floor", {}, [ROW], True),
        ("Greater", {}, [ROW, drawn(1, 12)], True),
        ("Equal", {}, [WHOLE, WHOLE], False),
        ("Cast", {"to": TensorProto.INT64}, [ROW], True),
        ("Cast", {"to": TensorProto.FLOAT16}, [ROW], True),
        ("Cast", {"to": TensorProto.FLOAT}, [WHOLE], False),
        ("Relu", {}, [ROW], False),
    ],
)
def test_operators_that_turn_a_slope_into_a_step_are_known(op, attributes, inputs, is_step):
    model = network(op, attributes, inputs, 21)
    model.graph.output[0].CopyFrom(helper.make_tensor_value_info("y", TensorProto.FLOAT, [1]))
    once, later = (Reference(CanonicalNetwork.read(model.SerializeToString())) for _ in range(2))
    feeds = {"x": inputs[0]}
    assert later.steps(feeds) is is_step
    answer, found = once.run_with_steps(feeds)
    assert found is is_step and np.array_equal(answer, later.run(feeds))
