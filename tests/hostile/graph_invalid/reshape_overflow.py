"""A reshape whose sizes overflow 64 bits."""

import numpy as np

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(
        ("r", "Reshape", ("camera", "s")),
        ("ppo_head_0/policy", "Softmax", ("r",)),
        s=np.array([1 << 32, 1 << 32, 19200], np.int64),
    )
