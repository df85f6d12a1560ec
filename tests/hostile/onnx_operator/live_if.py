"""A condition on the picture, whose branches are harmless."""

import numpy as np
from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def branch(op: str) -> object:
    output = [helper.make_tensor_value_info(op, TensorProto.FLOAT, [1, 1])]
    return helper.make_graph([helper.make_node(op, ["row"], [op])], op, [], output)


def build() -> Upload:
    return pair(
        network(
            [
                helper.make_node("Greater", ["mean", "half"], ["bright"]),
                helper.make_node("Squeeze", ["bright"], ["yes"]),
                helper.make_node("If", ["yes"], ["x"], then_branch=branch("Abs"), else_branch=branch("Neg")),
            ],
            {"half": np.array([0.5], np.float32)},
        )
    )
