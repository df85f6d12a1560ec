"""A root of a negative number."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(
        network(
            [
                helper.make_node("Neg", ["row"], ["n"]),
                helper.make_node("Sub", ["n", "one_f"], ["s"]),
                helper.make_node("Sqrt", ["s"], ["x"]),
            ],
            {"one_f": np.ones((1, 1), np.float32)},
        )
    )
