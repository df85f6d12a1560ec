"""An operator that is not allowed: lstm."""

from tests.hostile.parts import Upload, one_node


def build() -> Upload:
    return one_node("LSTM", ["row", "row", "row"], None, hidden_size=8)
