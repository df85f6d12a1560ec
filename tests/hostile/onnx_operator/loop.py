"""A loop of 2^62 rounds."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    body = helper.make_graph(
        [helper.make_node("Identity", ["c"], ["d"]), helper.make_node("Abs", ["v"], ["w"])],
        "body",
        [helper.make_tensor_value_info(n, t, []) for n, t in (("i", 7), ("c", 9))]
        + [helper.make_tensor_value_info("v", 1, [1, 1])],
        [helper.make_tensor_value_info("d", 9, []), helper.make_tensor_value_info("w", 1, [1, 1])],
    )
    return pair(
        network(
            [helper.make_node("Loop", ["rounds", "", "row"], ["x"], body=body)], {"rounds": np.array(1 << 62, np.int64)}
        )
    )
