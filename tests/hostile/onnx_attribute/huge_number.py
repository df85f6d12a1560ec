"""Pads that overflow the arithmetic of sizes."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Conv", ["picture", "k"], {"k": np.ones((1, 120, 1, 1), np.float32)}, pads=[1 << 62, 0, 1 << 62, 0])
