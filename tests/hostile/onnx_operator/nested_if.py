"""Thirty conditions inside each other."""

import numpy as np
from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    inner = [helper.make_node("Identity", ["row"], ["r0"])]
    for depth in range(30):
        output = [helper.make_tensor_value_info(f"r{depth}", TensorProto.FLOAT, [1, 1])]
        branch = helper.make_graph(inner, f"b{depth}", [], output)
        inner = [
            helper.make_node("If", ["yes"], [f"r{depth + 1}"], then_branch=branch, else_branch=branch)
            if depth < 3
            else helper.make_node("If", ["yes"], [f"r{depth + 1}"], then_branch=branch)
        ]
    inner[0].output[0] = "x"
    return pair(network(inner, {"yes": np.array(True)}))
