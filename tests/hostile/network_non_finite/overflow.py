"""A network whose answer overflows."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(
        network(
            [helper.make_node("Mul", ["row", "big"], ["m"]), helper.make_node("Exp", ["m"], ["x"])],
            {"big": np.array([[1e30]], np.float32)},
        )
    )
