"""One weight that is minus infinity."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Mul", ["row", "w"], {"w": np.array([[-np.inf]], np.float32)})
