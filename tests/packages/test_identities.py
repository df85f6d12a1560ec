"""A model that was accepted once stays the same model: its identity hangs on no later version of this code.

Recorded before networks of any size were accepted; no line of the table may ever change.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from onnx import helper

from evaluation.packages.convert_process import admit_network
from evaluation.packages.limits import DEFAULT_LIMITS
from evaluation.packages.metadata import parse_metadata
from tests.hostile.parts import network
from tests.packages.coach import DEEP, SHALLOW, coach_graph, metadata_dict

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
    "deep, normalised": "da028aa285f010419c2aa219bb5110553be56b19039bd1bd7953dbdcfe3cf130",
    "matrix product": "28646db93f5a6e3ced1c26e7cfeb4de52fdd31a626fd1ec53ea450c34266a2a3",
    "mean": "370fc44664c661a59c8f7ff0877967fa3cf7bbde510c08055dadc59e59cb7f69",
    "padded": "2338455e20d94b9a83f58856a279cce2563ee8249b2f7484f2479fa2d9fa4f73",
    "shallow": "77c06eca4e3faeb27ba886f757104b86ffcf1db009881e591e02f39c12a903ad",
    "shallow continuous": "a3688102a5b16e2a2bd9e0709704fe2cb4f336724f2a78090da44d4f6e890211",
    "shallow sac": "d349d38c93ae14a08b36ebe069805321db19d1cbac24eacf9d60c94b5706f606",
    "shallow stereo": "d91ce69161b5c0e45923d71e7b505b10d404bb1d358a00bda1f3a145b3ba8383",
    "shallow with lidar": "8ba3916043b60ff809fba27db90c25a8e06f09606b3b3bc144cd00f3547ad489",
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
