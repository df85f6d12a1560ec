"""A batch normalisation in training mode."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node(
        "BatchNormalization",
        ["row", "one_f", "zero_f", "zero_f", "one_f"],
        {"one_f": np.ones(1, np.float32), "zero_f": np.zeros(1, np.float32)},
        training_mode=1,
    )
