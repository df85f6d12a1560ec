"""A dense layer whose sizes do not fit."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Gemm", ["row", "w"], {"w": np.ones((7, 1), np.float32)})
