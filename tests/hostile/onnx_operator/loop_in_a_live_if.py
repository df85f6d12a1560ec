"""A loop of 2^62 rounds that only a bright picture reaches."""

import numpy as np
from onnx import TensorProto, helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    body = helper.make_graph(
        [helper.make_node("Identity", ["c"], ["d"]), helper.make_node("Abs", ["v"], ["w"])],
        "body",
        [helper.make_tensor_value_info(n, t, []) for n, t in (("i", 7), ("c", 9))]
        + [helper.make_tensor_value_info("v", 1, [1, 1])],
        [helper.make_tensor_value_info("d", 9, []), helper.make_tensor_value_info("w", 1, [1, 1])],
    )
    output = [helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, 1])]
    loop = helper.make_graph([helper.make_node("Loop", ["rounds", "", "row"], ["out"], body=body)], "loop", [], output)
    plain = helper.make_graph([helper.make_node("Identity", ["row"], ["out"])], "plain", [], output)
    return pair(
        network(
            [
                helper.make_node("Greater", ["mean", "half"], ["bright"]),
                helper.make_node("Squeeze", ["bright"], ["yes"]),
                helper.make_node("If", ["yes"], ["x"], then_branch=loop, else_branch=plain),
            ],
            {"half": np.array([0.5], np.float32), "rounds": np.array(1 << 62, np.int64)},
        )
    )
