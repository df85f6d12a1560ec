"""An operator that is not allowed: one hot."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node(
        "OneHot",
        ["i", "d", "v"],
        {"i": np.zeros(1000, np.int64), "d": np.array(1_000_000, np.int64), "v": np.array([0, 1], np.float32)},
    )
