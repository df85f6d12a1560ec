"""A half precision weight that is infinite."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(
        network(
            [
                helper.make_node("Cast", ["row"], ["h"], to=10),
                helper.make_node("Mul", ["h", "w"], ["m"]),
                helper.make_node("Cast", ["m"], ["x"], to=1),
            ],
            {"w": np.array([[np.inf]], np.float16)},
        )
    )
