"""A resizing whose cost hangs on both sizes."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    scale = {"scale": np.array([1, 0.5, 0.5, 1], np.float32)}
    return one_node("Resize", ["picture", "", "scale"], scale, antialias=1, mode="linear")
