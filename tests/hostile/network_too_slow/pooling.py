"""Pooling windows of ten thousand values."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair

LIMITS = {"macs": 250_000_000}


def build() -> Upload:
    nodes = [
        helper.make_node("Reshape", ["picture", "planar"], ["p"]),
        helper.make_node("MaxPool", ["p"], ["c"], kernel_shape=[119, 159], pads=[59, 79, 59, 79]),
        helper.make_node("ReduceMean", ["c"], ["x"], axes=[2, 3], keepdims=0),
    ]
    return pair(network(nodes, {"planar": np.array([1, 1, 120, 160], np.int64)}))
