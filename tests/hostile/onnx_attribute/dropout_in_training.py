"""A dropout that is told to drop."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Dropout", ["row", "ratio", "mode"], {"ratio": np.array(0.5, np.float32), "mode": np.array(True)})
