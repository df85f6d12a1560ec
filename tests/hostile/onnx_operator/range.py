"""An operator that is not allowed: range."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node(
        "Range",
        ["a", "b", "c"],
        {"a": np.array(0.0, np.float32), "b": np.array(1e12, np.float32), "c": np.array(1.0, np.float32)},
    )
