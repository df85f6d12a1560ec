"""A sum of a column and a row."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    nodes = [
        helper.make_node("Add", ["row", "column"], ["a"]),
        helper.make_node("Mul", ["a", "line"], ["b"]),
        helper.make_node("ReduceMean", ["b"], ["x"], axes=[0, 1]),
    ]
    return pair(
        network(nodes, {"column": np.ones((100_000, 1), np.float32), "line": np.ones((1, 100_000), np.float32)})
    )
