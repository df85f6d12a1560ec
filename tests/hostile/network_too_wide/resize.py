"""Much out of little: Resize."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    axes = list(range(4))
    nodes = [
        helper.make_node("Resize", ["picture", "", "size"], ["much"]),
        helper.make_node("ReduceMean", ["much"], ["little"], axes=axes, keepdims=0),
        helper.make_node("Mul", ["little", "row"], ["x"]),
    ]
    return pair(network(nodes, {"size": np.array([1, 40, 40, 1], np.float32)}))
