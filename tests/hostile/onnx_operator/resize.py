"""An operator that is not allowed: resize."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Resize", ["picture", "", "scale"], {"scale": np.array([1, 1000, 1000, 1], np.float32)})
