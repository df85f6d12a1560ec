"""An operator that is not allowed: expand."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Expand", ["row", "size"], {"size": np.array([40_000, 40_000], np.int64)})
