"""A model that was accepted once stays the same model: its identity hangs on no later version of this code.

Hashes of networks as they are before any optimisation for our processors. No line of the table may ever change.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from onnx import helper

from paddock.packages.admission import admit_network
from paddock.packages.limits import DEFAULT_LIMITS
from paddock.packages.metadata import parse_metadata
from tests.hostile.parts import network
from tests.paddock.packages.coach import DEEP, SHALLOW, coach_graph, metadata_dict

CAMERA, STEREO = "FRONT_FACING_CAMERA", "STEREO_CAMERAS"
COACH = {
    "shallow": {},
    "shallow continuous": {"head": "continuous"},
    "shallow sac": {"head": "sac"},
    "shallow stereo": {"sensors": [STEREO]},
    "shallow with lidar": {"sensors": [CAMERA, "LIDAR"]},
    "deep, normalised": {"depth": DEEP, "batch_norm": True, "dropout": True},
    "padded": {"depth": SHALLOW, "padding": "SAME"},
}
IDENTITIES = {
    "deep, normalised": "7b5e356f6288fca7c824f6dd42a13081400632f8ec466073505c9049d6bc8d8a",
    "matrix product": "738517919bbfeec7dd4dc573ca016cfff892250ea7abb5e38654bfeadc822f61",
    "mean": "370fc44664c661a59c8f7ff0877967fa3cf7bbde510c08055dadc59e59cb7f69",
    "padded": "6c0e8c46e2b65058dbb2fc1c06ddcf3b08e0040c3d62ff3ee38438ce79d2183b",
    "shallow": "77a5c474ccfd33769322790562f3c29dea47b326aef437d471738c7d482984df",
    "shallow continuous": "9c389afea21f60a189827f92c89c85dbb1828092911f119cbfdb81bbab723ca2",
    "shallow sac": "544e58dfae8258be86a3de71e79fae01ec332e8e44bd7817e2b82ce5b8f1b451",
    "shallow stereo": "a365e6b72a3641f1dcb4868eecdd44be89598045292b447fff3d8d4afdadaf48",
    "shallow with lidar": "28cac4be3aa6f48751567277e74a15ea13e35f1ed351aa35883c5585ac719c00",
}


def dense_network() -> bytes:
    """A large dense layer behind a picture, with a matrix product, as other exporters write it."""
    random = np.random.default_rng(7)
    nodes = [
        helper.make_node("Transpose", ["picture"], ["planes"], perm=[0, 3, 1, 2]),
        helper.make_node("Conv", ["planes", "kernel"], ["maps"], strides=[4, 4]),
        helper.make_node("Relu", ["maps"], ["on"]),
        helper.make_node("Flatten", ["on"], ["flat"]),
        helper.make_node("MatMul", ["flat", "wide"], ["hidden"]),
        helper.make_node("Add", ["hidden", "offset"], ["shifted"]),
        helper.make_node("Tanh", ["shifted"], ["bounded"]),
        helper.make_node("Gemm", ["bounded", "narrow"], ["scores"]),
    ]
    weights = {
        "kernel": random.standard_normal((16, 1, 8, 8)).astype(np.float32),
        "wide": random.standard_normal((16 * 29 * 39, 128)).astype(np.float32),
        "offset": random.standard_normal(128).astype(np.float32),
        "narrow": random.standard_normal((128, 5)).astype(np.float32),
    }
    return network(nodes, weights).SerializeToString()


def identity_of(name: str) -> str:
    if name in COACH:
        said = {key: value for key, value in COACH[name].items() if key in ("sensors", "depth", "head")}
        kind, data, told = "tensorflow", coach_graph(**COACH[name], seed=11), metadata_dict(**said)
    else:
        kind, told = "onnx", metadata_dict()
        data = dense_network() if name == "matrix product" else network().SerializeToString()
    return admit_network(kind, data, parse_metadata(json.dumps(told).encode()), DEFAULT_LIMITS).sha256


@pytest.mark.parametrize("name", sorted(IDENTITIES))
def test_a_model_keeps_its_identity(name: str) -> None:
    assert identity_of(name) == IDENTITIES[name]
