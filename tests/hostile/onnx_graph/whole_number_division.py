"""Whole numbers divided by zero: the runtime would die of it."""

import numpy as np
from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(
        network(
            [
                helper.make_node("Cast", ["row"], ["i"], to=7),
                helper.make_node("Div", ["i", "zero"], ["j"]),
                helper.make_node("Cast", ["j"], ["x"], to=1),
            ],
            {"zero": np.array([[0]], np.int64)},
        )
    )
