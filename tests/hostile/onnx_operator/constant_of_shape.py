"""An operator that is not allowed: constant of shape."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("ConstantOfShape", ["size"], {"size": np.array([40_000, 40_000, 4], np.int64)})
