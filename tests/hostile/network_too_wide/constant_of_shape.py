"""Much out of little: ConstantOfShape."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    axes = list(range(2))
    nodes = [
        helper.make_node("ConstantOfShape", ["size"], ["much"]),
        helper.make_node("ReduceMean", ["much"], ["little"], axes=axes, keepdims=0),
        helper.make_node("Mul", ["little", "row"], ["x"]),
    ]
    return pair(network(nodes, {"size": np.array([4_000, 4_000], np.int64)}))
