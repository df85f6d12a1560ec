"""One convolution over the whole picture with a kernel as large as it."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair

LIMITS = {"macs": 250_000_000}


def build() -> Upload:
    nodes = [
        helper.make_node("Reshape", ["picture", "planar"], ["p"]),
        helper.make_node("Conv", ["p", "kernel"], ["c"], pads=[80, 80, 80, 80]),
        helper.make_node("GlobalMaxPool", ["c"], ["g"]),
        helper.make_node("ReduceMean", ["g"], ["x"], axes=[2, 3], keepdims=0),
    ]
    return pair(
        network(
            nodes, {"planar": np.array([1, 1, 120, 160], np.int64), "kernel": np.ones((1, 1, 101, 101), np.float32)}
        )
    )
