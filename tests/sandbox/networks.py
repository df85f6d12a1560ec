"""Small ONNX networks for tests, with the interface that racers' networks have."""

from __future__ import annotations

import functools

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CAMERA = "FRONT_FACING_CAMERA"
HEADER = {"inputs": [{"name": CAMERA, "dtype": "uint8", "shape": [120, 160, 1]}], "outputs": 3}
METADATA = {
    "action_space": [
        {"steering_angle": angle, "speed": 1.0, "index": index} for index, angle in enumerate((-20.0, 0.0, 20.0))
    ],
    "sensor": [CAMERA],
    "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "training_algorithm": "clipped_ppo",
    "action_space_type": "discrete",
    "version": "5",
}


@functools.cache
def small_network(outputs: int = 3, channels_first: bool = False, seed: int = 0) -> bytes:
    """One layer over the camera, random weights."""
    rng = np.random.default_rng(seed)
    weights = (rng.standard_normal((120 * 160, outputs)) * 0.001).astype(np.float32)
    return _model(
        [
            helper.make_node("Cast", [CAMERA], ["picture"], to=TensorProto.FLOAT),
            helper.make_node("Flatten", ["picture"], ["row"]),
            helper.make_node("MatMul", ["row", "weights"], ["output"]),
        ],
        {"weights": weights},
        outputs,
        [1, 1, 120, 160] if channels_first else [1, 120, 160, 1],
    )


@functools.cache
def constant_network(values: tuple[float, ...]) -> bytes:
    """Answers ``values`` whatever it sees (NaN and infinity too)."""
    return _model(
        [
            helper.make_node("Cast", [CAMERA], ["picture"], to=TensorProto.FLOAT),
            helper.make_node("Flatten", ["picture"], ["row"]),
            helper.make_node("MatMul", ["row", "zeros"], ["nothing"]),
            helper.make_node("Add", ["nothing", "values"], ["output"]),
        ],
        {
            "zeros": np.zeros((120 * 160, len(values)), np.float32),
            "values": np.array([values], np.float32),
        },
        len(values),
        [1, 120, 160, 1],
    )


@functools.cache
def console_sized_network(outputs: int = 3, seed: int = 0) -> bytes:
    """The layers of the console's three-layer network (5.8 million weights, 23 MB), random weights."""
    rng = np.random.default_rng(seed)

    def layer(*shape: int) -> np.ndarray:
        return (rng.standard_normal(shape) / np.sqrt(np.prod(shape[1:]))).astype(np.float32)

    nodes = [
        helper.make_node("Cast", [CAMERA], ["picture"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["picture"], ["chw"], perm=[0, 3, 1, 2]),
        helper.make_node("Mul", ["chw", "scale"], ["x0"]),
    ]
    weights = {"scale": np.array(1 / 255, np.float32)}
    shapes = [((32, 1, 8, 8), 4), ((64, 32, 4, 4), 2), ((64, 64, 3, 3), 1)]
    for number, (shape, stride) in enumerate(shapes):
        weights[f"k{number}"] = layer(*shape)
        nodes.append(helper.make_node("Conv", [f"x{number}", f"k{number}"], [f"c{number}"], strides=[stride, stride]))
        nodes.append(helper.make_node("Relu", [f"c{number}"], [f"x{number + 1}"]))
    features = 64 * 11 * 16
    weights["w1"] = layer(512, features).T.copy()
    weights["w2"] = layer(outputs, 512).T.copy()
    nodes += [
        helper.make_node("Flatten", ["x3"], ["flat"]),
        helper.make_node("MatMul", ["flat", "w1"], ["h"]),
        helper.make_node("Relu", ["h"], ["hr"]),
        helper.make_node("MatMul", ["hr", "w2"], ["output"]),
    ]
    return _model(nodes, weights, outputs, [1, 120, 160, 1])


def _model(nodes: list, weights: dict[str, np.ndarray], outputs: int, shape: list[int]) -> bytes:
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info(CAMERA, TensorProto.UINT8, shape)],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, outputs])],
        [numpy_helper.from_array(value, name) for name, value in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    return model.SerializeToString(deterministic=True)
