"""An operator that is not allowed: pad."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Pad", ["row", "size"], {"size": np.array([0, 0, 40_000, 40_000], np.int64)})
