"""A sum of pictures and whole numbers."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Add", ["row", "i"], {"i": np.ones((1, 1), np.int64)})
