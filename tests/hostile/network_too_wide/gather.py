"""A million copies of one value."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    nodes = [
        helper.make_node("Gather", ["row", "index"], ["a"], axis=0),
        helper.make_node("ReduceMean", ["a"], ["x"], axes=[0]),
    ]
    return pair(network(nodes, {"index": np.zeros(9_000_000, np.int32)}))
