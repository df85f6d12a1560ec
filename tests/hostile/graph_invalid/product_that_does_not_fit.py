"""A matrix product whose sizes do not fit."""

import numpy as np

from tests.hostile.parts import Upload, graph_with


def build() -> Upload:
    return graph_with(
        ("r", "Reshape", ("camera", "s")),
        ("ppo_head_0/policy", "MatMul", ("r", "w")),
        s=np.array([1, 19200], np.int32),
        w=np.ones((7, 5), np.float32),
    )
