"""The network, in torch for learning and in ONNX for racing."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from .environment import POOL, SENSOR

FEATURES = 128
FRAME = (1, 1, 120, 160)
OPSET = 17
IR_VERSION = 10


class SmallEyes(BaseFeaturesExtractor):
    """(N, 1, 30, 40) in [0, 1] to 128 features: two convolutions and a dense layer, 203 thousand weights."""

    def __init__(self, observation_space: gymnasium.Space) -> None:
        super().__init__(observation_space, FEATURES)
        self.layers = nn.Sequential(
            nn.Conv2d(1, 16, 5, stride=2),
            nn.ReLU(),
            nn.Conv2d(16, 32, 3, stride=2),
            nn.ReLU(),
            nn.Flatten(),
            nn.Linear(32 * 6 * 8, FEATURES),
            nn.ReLU(),
        )

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features of a batch of frames."""
        return self.layers(observations)


def to_onnx(policy: ActorCriticPolicy) -> bytes:
    """The deterministic policy by the ONNX contract: ``FRONT_FACING_CAMERA`` float32 [1,1,120,160], 0-255, to one row.

    The pooling of :func:`training.house_cars.environment.pool` comes first and its division by 255 goes into the first
    convolution's weights. Written operator by operator, so that the file holds nothing but what is needed.
    """
    layers: Any = policy.features_extractor.layers
    first, _, second, _, _, dense, _ = layers
    weights = {
        "conv1": first.weight / 255.0,
        "conv1_bias": first.bias,
        "conv2": second.weight,
        "conv2_bias": second.bias,
        "dense": dense.weight,
        "dense_bias": dense.bias,
        "head": policy.action_net.weight,
        "head_bias": policy.action_net.bias,
    }
    pool: dict[str, Any] = {"kernel_shape": [POOL, POOL], "strides": [POOL, POOL]}
    nodes = [
        helper.make_node("AveragePool", [SENSOR], ["pooled"], **pool),
        helper.make_node("Conv", ["pooled", "conv1", "conv1_bias"], ["edges"], kernel_shape=[5, 5], strides=[2, 2]),
        helper.make_node("Relu", ["edges"], ["edges_on"]),
        helper.make_node("Conv", ["edges_on", "conv2", "conv2_bias"], ["shapes"], kernel_shape=[3, 3], strides=[2, 2]),
        helper.make_node("Relu", ["shapes"], ["shapes_on"]),
        helper.make_node("Flatten", ["shapes_on"], ["flat"], axis=1),
        helper.make_node("Gemm", ["flat", "dense", "dense_bias"], ["features"], transB=1),
        helper.make_node("Relu", ["features"], ["features_on"]),
        helper.make_node("Gemm", ["features_on", "head", "head_bias"], ["actions"], transB=1),
    ]
    arrays = {name: np.ascontiguousarray(weight.detach().numpy(), np.float32) for name, weight in weights.items()}
    graph = helper.make_graph(
        nodes,
        "house-car",
        [helper.make_tensor_value_info(SENSOR, TensorProto.FLOAT, FRAME)],
        [helper.make_tensor_value_info("actions", TensorProto.FLOAT, [1, arrays["head"].shape[0]])],
        [numpy_helper.from_array(array, name) for name, array in arrays.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="paddock")
    model.ir_version = IR_VERSION
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)
