"""An index that is found wrong only when the network runs."""

import numpy as np

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("Gather", ["row", "index"], {"index": np.array([99], np.int64)}, axis=1)
